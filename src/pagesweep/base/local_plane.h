// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "pagesweep/base/image.h"

namespace pagesweep {

/// A plane over the pixels around one: value = across i + down j + middle, at i columns to the right and j rows down.
struct LocalPlane {
  float across = 0, down = 0, middle = 0;
  float at(float i, float j) const { return across * i + down * j + middle; }
};

/// The values around one pixel, and planes through them. It holds scratch memory: one a thread.
class Neighbourhood {
 public:
  /// The finite values of the (2 radius + 1)^2 pixels around (x, y), less that of (x, y) itself: small differences of
  /// large values stay exact. \pre the value at (x, y) is finite
  void gather(const Image<float>& values, int x, int y, int radius);
  std::size_t size() const;  ///< finite values

  /// Least squares over the values that miss `before` by at most `limit`; nothing if they are fewer than six or on
  /// a line.
  std::optional<LocalPlane> fit(const LocalPlane& before, float limit) const;
  /// Over all values.
  std::optional<LocalPlane> fit() const;
  /// Over all, and if some miss the plane by more than three times the median, again without these: another surface
  /// behind an edge.
  std::optional<LocalPlane> fit_robustly();

  /// Median of the distances from a plane, to a hundredth, and whether any of them is more than three times as much.
  std::pair<float, bool> median_miss(const LocalPlane& plane);

 private:
  void set_radius(int radius);

  int radius_ = -1;
  std::vector<float> i_, j_;             ///< places of the window, padded with zeros
  std::vector<float> values_, scratch_;  ///< NaN where there is none
};

/// Whether the plane, fitted around (x, y), is that of one surface: every finite value in the window keeps to it
/// within six of its standard deviations and half of what the plane changes by in a pixel, which is as much as print
/// under a pixel shifts a value.
bool is_one_surface(const LocalPlane& plane, const Image<float>& values, const Image<float>& sigmas, int x, int y,
                    int radius);

}  // namespace pagesweep
