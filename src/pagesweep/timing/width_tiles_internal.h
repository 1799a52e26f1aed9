// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "pagesweep/base/image.h"
#include "pagesweep/timing/pixel_window_internal.h"
#include "pagesweep/timing/stripe_width.h"

namespace pagesweep {

inline constexpr int width_tile_px = 32;

/// A part of a picture in which the stripe's width is measured as a whole.
struct WidthTile {
  int left, top, width, height;  ///< [px]
};
WidthTile width_tile(int width, int height, int column, int row);
/// How many tiles cover that many pixels.
int width_tiles(int pixels);

/// Calls body(x, y) for the pixels of a tile whose width is fitted: some 40, half a percent each, a thousandth
/// together.
template <class Body>
void for_width_pixels(const WidthTile& tile, const Body& body) {
  constexpr int row_step = 8, column_step = 3;
  for (int y = tile.top; y < tile.top + tile.height; y += row_step) {
    // The columns take turns, counted over the whole picture.
    const int phase = y / row_step % column_step;
    const int first = tile.left + (phase - tile.left % column_step + column_step) % column_step;
    for (int x = first; x < tile.left + tile.width; x += column_step) body(x, y);
  }
}

/// Of the stripe search. With less, a pixel's width would be worth little.
inline constexpr double least_significance_of_width = 15;

/// What one pixel tells.
struct MeasuredWidth {
  double log_width, weight;
};
/// Adds it unless it is worth nothing.
void note_width(double log_width, double sigma, double reduced_chi_square, std::vector<MeasuredWidth>& widths);
/// Fits the width of one pixel and adds it.
void measure_width_alone(const PixelWindow& window, const StripeProfile& profile, const FrameNoise& noise,
                         std::vector<MeasuredWidth>& widths);
/// Weighted mean of what is near the weighted median; NaN without any.
float robust_width(std::vector<MeasuredWidth>& widths);

/// The widths of all pixels from those of the tiles. Tiles without a value take their neighbours'.
StripeWidths widths_of_tiles(Image<float> tiles);

}  // namespace pagesweep
