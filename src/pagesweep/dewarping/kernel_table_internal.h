// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>

#include "pagesweep/base/image.h"
#include "pagesweep/dewarping/resample.h"

namespace pagesweep {

/// Scan positions are rounded to this many fractions of a pixel.
constexpr int phase_bits = 9;
constexpr int phases_per_px = 1 << phase_bits;

/// Kernel widths are told apart in steps of 1/32 and limited to 32.
constexpr float widths_per_unit = 32, largest_width = 32;
constexpr int kernel_widths = static_cast<int>((largest_width - 1) * widths_per_unit) + 1;
constexpr double width_of(int index) { return 1 + index / double(widths_per_unit); }

/// Taps of a kernel of some width: pixels first_tap() ... first_tap() + taps - 1, counted from the position's floor.
int taps_of(ResampleKernel kernel, double width);
constexpr int first_tap(int taps) { return 1 - taps / 2; }

/// Weights of all taps for a position `fraction` beyond a pixel's centre; they sum to 1.
void compute_weights(ResampleKernel kernel, double width, double fraction, std::span<float> weights);

/// How weights are laid out for sums over `lanes` neighbouring samples at once.
struct LaneLayout {
  int lanes = 1;
  int channels = 1;
  int pixels = 1;                                 ///< in so many lanes
  int used() const { return pixels * channels; }  ///< the lanes beyond weigh nothing
};

/// One table of weights.
template <class Weight>
struct KernelRows {
  const Weight* first;
  std::ptrdiff_t stride;
  int shift;  ///< a wide kernel changes little from one phase to the next: 2^shift of them share a row

  /// \param phase  0 to phases_per_px - 1
  const Weight* operator[](int phase) const { return first + (phase >> shift) * stride; }
};

/// The weights of one kernel width for all fractions of a pixel.
/// \tparam Weight  float, or std::int16_t: in units of 2^-15, a single 1 being 1 - 2^-15
template <class Weight>
class KernelTable {
 public:
  KernelTable(ResampleKernel kernel, double width, const LaneLayout& layout);

  int taps() const { return taps_; }
  int chunks() const { return chunks_; }  ///< of layout.used() samples, that hold all taps
  /// One weight a tap.
  KernelRows<Weight> down() const { return rows_of(down_); }
  /// In fixed point for gray pixels: each weight as often as a chunk has lanes, so that whole vectors are multiplied.
  KernelRows<Weight> down_spread() const { return rows_of(down_spread_); }
  /// The same as down() for each channel of all taps, in chunks of `lanes`.
  KernelRows<Weight> across() const { return rows_of(across_); }

 private:
  KernelRows<Weight> rows_of(const Image<Weight>& table) const { return {table.data(), table.width(), shift_}; }

  int taps_, chunks_;
  int shift_;  ///< see KernelRows
  Image<Weight> down_, down_spread_, across_;
};

/// Tables of all widths, each made when it is first asked for, by whatever thread.
template <class Weight>
class KernelTables {
 public:
  KernelTables(ResampleKernel kernel, const LaneLayout& layout) : kernel_(kernel), layout_(layout) {}
  const KernelTable<Weight>& operator[](int width);

 private:
  ResampleKernel kernel_;
  LaneLayout layout_;
  std::array<std::once_flag, kernel_widths> made_;
  std::array<std::unique_ptr<KernelTable<Weight>>, kernel_widths> tables_;
};

}  // namespace pagesweep
