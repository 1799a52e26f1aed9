// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/base/image.h"
#include "pagesweep/timing/recorded_windows_internal.h"
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

/// Logarithm of the relative width in one tile; NaN where there is too little light.
float measure_width(RecordedWindows& row, const WidthTile& tile, const StripeProfile& profile, const FrameNoise& noise);

/// The widths of all pixels from those of the tiles. Tiles without a value take their neighbours'.
StripeWidths widths_of_tiles(Image<float> tiles);

}  // namespace pagesweep
