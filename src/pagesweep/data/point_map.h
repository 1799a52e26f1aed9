// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/base/filled_image.h"
#include "pagesweep/data/time_map.h"

namespace pagesweep {

/// For each pixel of one camera, the measured point of the surface. Where status is not ok, all values
/// but intensity are NaN.
struct PointMap {
  PointMap() = default;
  PointMap(int width, int height)
      : x(filled_image(width, height, not_a_number)),
        y(filled_image(width, height, not_a_number)),
        z(filled_image(width, height, not_a_number)),
        nx(filled_image(width, height, not_a_number)),
        ny(filled_image(width, height, not_a_number)),
        nz(filled_image(width, height, not_a_number)),
        intensity(filled_image(width, height, not_a_number)),
        sigma(filled_image(width, height, not_a_number)),
        status(filled_image(width, height, PixelStatus::not_computed)) {}
  int width() const { return x.width(); }
  int height() const { return x.height(); }

  Image<float> x, y, z;     ///< [mm] rig frame
  Image<float> nx, ny, nz;  ///< unit normal, towards the camera
  Image<float> intensity;   ///< [gray values] amplitude of the stripe there
  Image<float> sigma;       ///< [mm] one standard deviation along the viewing ray
  Image<PixelStatus> status;
};

}  // namespace pagesweep
