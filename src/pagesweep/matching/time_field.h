// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "pagesweep/base/image.h"
#include "pagesweep/data/pixel_set.h"
#include "pagesweep/data/time_map.h"
#include "pagesweep/matching/follow_curves.h"

namespace pagesweep {

/// A time map that can be asked between its pixels, and knows where it must not be.
///
/// Neighbouring pixels are linked if both are valid and no jump lies between them. A jump is a difference that is more
/// than three times that of the pixel pairs on both sides, beyond six standard deviations: an edge of one surface
/// before another, where a value between the two would be nobody's.
class TimeField {
 public:
  explicit TimeField(const TimeMap& map);
  /// Of a map of that size, which knows nothing yet.
  TimeField(int width, int height);

  /// Takes note of times that are new, of these pixels alone. The map must outlive this.
  /// \param news  null: all pixels
  void update(const TimeMap& map, const PixelSet* news);

  /// Time at a position [frames] by bilinear interpolation; NaN where a pixel that takes part is missing or not linked.
  double time_at(const Eigen::Vector2d& pixel) const;
  /// Amplitude at a position [gray values] by bilinear interpolation.
  double amplitude_at(const Eigen::Vector2d& pixel) const;
  /// Variance [frames^2] of time_at, from the pixels' own sigma. \pre time_at is a number
  double variance_at(const Eigen::Vector2d& pixel) const;
  /// \pre the map is at least 2 x 2
  TimeArrays arrays() const;

 private:
  struct Cell {
    int x, y;
    double a, b;
  };
  void bound_blocks(const PixelSet* news);
  Cell cell_at(const Eigen::Vector2d& pixel) const;

  const TimeMap* map_ = nullptr;
  Image<float> earliest_, latest_;                ///< of each block of pixels, and of the row and column behind it
  Image<float> earliest_around_, latest_around_;  ///< see TimeArrays
  Image<float> between_;  ///< 0 where the four pixels from (x, y) to (x + 1, y + 1) are linked, NaN where not
};

}  // namespace pagesweep
