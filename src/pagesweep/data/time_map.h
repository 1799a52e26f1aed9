// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>

#include "pagesweep/base/filled_image.h"
#include "pagesweep/data/status.h"

namespace pagesweep {

inline constexpr float not_a_number = std::numeric_limits<float>::quiet_NaN();

/// When the stripe's middle passed each pixel of one camera. Where status is not ok, time and sigma are NaN.
struct TimeMap {
  TimeMap() = default;
  TimeMap(int width, int height)
      : time(filled_image(width, height, not_a_number)),
        sigma(filled_image(width, height, not_a_number)),
        amplitude(filled_image(width, height, not_a_number)),
        residual(filled_image(width, height, not_a_number)),
        status(filled_image(width, height, PixelStatus::not_computed)) {}
  int width() const { return time.width(); }
  int height() const { return time.height(); }

  Image<float> time;       ///< [frames] 0 = exposure of frame 0
  Image<float> sigma;      ///< [frames] one standard deviation of time
  Image<float> amplitude;  ///< [gray values] height of the bell above its background: light times albedo
  Image<float> residual;   ///< rms of the fit's residuals over the noise expected there: 1 where the model holds
  Image<PixelStatus> status;
};

}  // namespace pagesweep
