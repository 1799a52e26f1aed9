// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "pagesweep/data/page.h"
#include "pagesweep/dewarping/kernel_table_internal.h"

namespace pagesweep {

/// Where neighbouring pixels of a page row look in the scan.
struct Lookups {
  static constexpr int most = 128;
  static constexpr std::int32_t hidden = -1;

  int count = 0;
  alignas(64) std::int32_t u[most], v[most];              ///< [1 / phases_per_px px]; undefined where hidden
  alignas(64) std::int32_t width_u[most], width_v[most];  ///< index of the kernel's width; `hidden` in both, or none
  bool alike = false;                                     ///< whether the widths of all pixels are the same
  std::int32_t low_u, high_u, low_v, high_v;              ///< bounds of all u and v
};

/// Looks up page pixels (x ... x + count - 1, y), at most Lookups::most.
///
/// The kernel's width along u is the map's change from one page pixel to the next, sqrt((du/dx)^2 + (du/dy)^2), at
/// least 1; likewise along v. Of the differences to the two neighbours on an axis the smaller one counts: where the map
/// jumps, across a hidden strip, the other side is the neighbour on the paper. A pixel that has no neighbour on one
/// axis is judged by the other one.
void look_up(const ScanMap& map, int x, int y, int count, int scan_width, int scan_height, Lookups& out);

/// Some of these pixels: their kernels have the same widths and lie within the scan.
template <class T, class Weight>
struct ResampleRun {
  const T* scan;
  std::ptrdiff_t stride;  ///< [samples] from one row of the scan to the next
  int channels;
  const KernelTable<Weight>* across;
  const KernelTable<Weight>* down;
  const std::int32_t* u;  ///< [1 / phases_per_px px]
  const std::int32_t* v;
  int count;
  T* out;
};

/// Weighted sums, rounded and clipped to the samples' range. With 16 bit weights sums have 6 binary places, and stay in
/// range for kernels whose positive weights sum to less than 1.3.
///
/// Whole vectors are read: up to a layout's lanes of samples beyond the last tap, which need not lie in the scan's row,
/// but in memory that can be read.
void resample_run(const ResampleRun<std::uint8_t, std::int16_t>& run);
void resample_run(const ResampleRun<std::uint8_t, float>& run);
void resample_run(const ResampleRun<std::uint16_t, float>& run);

/// The layouts of tables that resample_run() expects on this machine.
LaneLayout fixed_point_layout(int channels);
LaneLayout float_layout(int channels);

}  // namespace pagesweep
