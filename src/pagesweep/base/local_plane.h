// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <optional>

#include "pagesweep/base/image.h"

namespace pagesweep {

/// A plane over the pixels around one: value = across i + down j + middle, at i columns to the right and j rows down,
/// less the value of the pixel itself: small differences of large values stay exact.
struct LocalPlane {
  float across = 0, down = 0, middle = 0;
};

/// Some pixels of one row, and the planes around them.
struct PlaneBatch {
  static constexpr std::size_t most = 16;
  template <class T>
  using Each = std::array<T, most>;

  int row = 0;
  std::size_t count = 0;
  alignas(64) Each<int> column{};

  alignas(64) Each<float> across{}, down{}, middle{};  ///< NaN where there is no plane
  alignas(64) Each<float> size{};                      ///< finite values in the window
  alignas(64) Each<float> median{};                    ///< of their distances from the plane through all of them

  bool found(std::size_t k) const { return !std::isnan(across[k]); }
  LocalPlane plane(std::size_t k) const { return {across[k], down[k], middle[k]}; }
};

/// Fits planes to the finite values of the (2 radius + 1)^2 pixels around some pixels, side by side. It holds scratch
/// memory: one a thread.
class PlaneFitter {
 public:
  explicit PlaneFitter(int radius);

  /// Least squares over all values; if some miss that plane by more than three times the median (known to a hundredth),
  /// again without these: another surface behind an edge. No plane where the values are fewer than six or on a line.
  /// \pre the values at the pixels themselves are finite
  void fit(const Image<float>& values, PlaneBatch& batch);

  /// Whether each plane of the last fit() is that of one surface: every finite value in the window keeps to it within
  /// six of its standard deviations and half of what the plane changes by in a pixel, which is as much as print under a
  /// pixel shifts a value. False where there is no plane.
  PlaneBatch::Each<bool> are_one_surface(const Image<float>& sigmas, const PlaneBatch& batch) const;

 private:
  int radius_;
  Image<float> window_, misses_;  ///< a row for each place of the window, a column for each pixel
};

/// Calls use(batch) for the pixels of a row for which is_wanted(x), a batch of them at a time.
template <class IsWanted, class Use>
void in_batches(int width, int row, const IsWanted& is_wanted, const Use& use) {
  PlaneBatch batch;
  batch.row = row;
  for (int x = 0; x < width; ++x) {
    if (is_wanted(x)) batch.column[batch.count++] = x;
    if (batch.count == PlaneBatch::most || (x + 1 == width && batch.count > 0)) {
      use(batch);
      batch.count = 0;
    }
  }
}

/// The plane around one pixel, as PlaneFitter finds it.
std::optional<LocalPlane> fit_plane(const Image<float>& values, int x, int y, int radius);

}  // namespace pagesweep
