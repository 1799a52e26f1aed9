// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/base/filled_image.h"
#include "pagesweep/data/time_map.h"

namespace pagesweep {

/// For each pixel of one camera, the place in the other camera that sees the same spot of surface.
/// Where status is not ok, u, v and sigma are NaN.
struct Correspondences {
  Correspondences() = default;
  Correspondences(int width, int height)
      : u(filled_image(width, height, not_a_number)),
        v(filled_image(width, height, not_a_number)),
        sigma(filled_image(width, height, not_a_number)),
        slope(filled_image(width, height, not_a_number)),
        status(filled_image(width, height, PixelStatus::not_computed)) {}
  int width() const { return u.width(); }
  int height() const { return u.height(); }

  Image<float> u, v;   ///< [px] in the other camera's picture, on this pixel's epipolar curve
  Image<float> sigma;  ///< [px] one standard deviation along that curve
  Image<float> slope;  ///< [frames/px] of the other camera's times along it, towards nearer points; NaN without times
  Image<PixelStatus> status;
};

}  // namespace pagesweep
