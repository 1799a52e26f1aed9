// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

namespace pagesweep {

/// Light that can be asked for between its pixels, bilinearly. Rows can be read `spot_padding` pixels beyond their
/// ends, which need not be theirs.
struct LightArray {
  const float* first;
  std::ptrdiff_t stride;  ///< [px] from one row to the next
};
inline constexpr int spot_padding = 8;

/// A Gaussian spot and the square of pixels that holds it.
struct GaussianSpot {
  float u, v;         ///< [px] its middle, from the first pixel of the square
  float uu, uv, vv;   ///< [1/px^2] it weighs exp(-(uu i^2 + 2 uv i j + vv j^2) / 2) at (i, j) from its middle
  float most;         ///< of uu i^2 + 2 uv i j + vv j^2: beyond, it weighs nothing
  int columns, rows;  ///< [px] of the square; one more of each is read
  int parts;          ///< places are 1 / parts px apart where the spot is smaller than a pixel,
  int row_step;       ///< and in every row_step-th row only, where it is much larger

  /// Whether weights all over the square are numbers that can be multiplied.
  bool weighs_everywhere() const;
};

/// Sums over places: of the spot's weight times the light, and of that times the place's distance from the middle [px].
struct SpotSums {
  float light, u, v;
};

/// \param corner  of the square
SpotSums sum_spot(const LightArray& corner, const GaussianSpot& spot);

}  // namespace pagesweep
