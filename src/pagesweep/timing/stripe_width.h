// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <utility>

#include "pagesweep/base/image.h"
#include "pagesweep/data/frames.h"
#include "pagesweep/timing/sensor_noise.h"
#include "pagesweep/timing/stripe_profile.h"

namespace pagesweep {

/// [relative to the profile] No stripe is taken to be wider, nor narrower than its inverse.
inline constexpr double widest_stripe = 1.5;

/// How wide the stripe is in each part of a camera's picture, relative to its profile. Light diverges, so paper nearer
/// to the lamp sees a narrower stripe; unless that is known, bright pixels fit worse than their noise allows, and time
/// values from one flank (skewed stripes, clipped samples) are off.
class StripeWidths {
 public:
  StripeWidths() = default;
  StripeWidths(Image<float> log_width, int tile_px) : log_width_(std::move(log_width)), tile_px_(tile_px) {}

  /// Relative width at a pixel, bilinear between the tiles' middles; 1 if nothing is known.
  double at(int x, int y) const;
  /// The logarithms of the relative widths of pixels (left, y), (left + 1, y), ...
  void log_row(int y, int left, std::span<float> log_widths) const;
  /// Logarithm of one tile's relative width; beyond the tiles, of the nearest one.
  float tile(int column, int row) const;
  /// Of the tiles, lowest and highest.
  std::pair<double, double> range() const;

 private:
  Image<float> log_width_;  ///< one entry a tile
  int tile_px_ = 1;
};

/// Measures them: robust weighted means, tile by tile, over a sparse grid of pixels whose width is fitted as a fourth
/// unknown. Tiles without light take their neighbours' value.
StripeWidths measure_widths(const Frames& frames, const StripeProfile& profile, const SensorNoise& noise);

}  // namespace pagesweep
