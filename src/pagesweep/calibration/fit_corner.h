// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>

#include "pagesweep/base/image.h"

namespace pagesweep {

/// Where a corner of four squares is to be looked for.
struct CornerGuess {
  Eigen::Vector2d pixel;     ///< [px]
  Eigen::Vector2d right_px;  ///< the picture of one square's side along the board's x axis
  Eigen::Vector2d up_px;     ///< and along y
  bool upper_right_is_black = false;
  double margin = 0.4;  ///< of a square's side beside its edges that nothing else is printed on
};

/// A corner found.
struct CornerFit {
  Eigen::Vector2d pixel;  ///< [px]
  double blur_px = 0;     ///< standard deviation of the Gaussian that turns a step into the edge seen, pixel included
  double contrast = 0;    ///< white minus black [gray values]
  double misfit = 0;      ///< rms of model minus picture, as a part of the contrast
  double clipped = 0;     ///< share of the white samples that have the highest gray value
};

/// Maximum-likelihood position of a corner: two straight edges, blurred by a Gaussian, under light that varies
/// linearly:
///     I(x) = (1 + g . (x - c)) (m +- a erf(l1(x) / (sqrt(2) s)) erf(l2(x) / (sqrt(2) s))),
/// l1 and l2 being the signed distances to the edges through the corner c. Only samples near the edges count, so that a
/// marker in a white square does no harm, and the edges are followed nearly half a square far.
/// \return nothing if the picture has no such corner near the guess
std::optional<CornerFit> fit_corner(ImageView<const std::uint8_t> image, const CornerGuess& guess);

/// A dark disc on white, as an ellipse with a blurred rim, found likewise; `blur_px`, ... as for corners.
/// \param radius_px  about
std::optional<CornerFit> fit_disc(ImageView<const std::uint8_t> image, const Eigen::Vector2d& guess_px,
                                  double radius_px);

}  // namespace pagesweep
