// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/camera/light.h"

namespace pagesweep {

/// Where a viewing ray meets the sheet of light as it stood at some time.
struct LightSection {
  double distance_mm = 0;   ///< along the ray; not positive or finite if it does not meet the sheet in front
  double mm_per_frame = 0;  ///< speed of the meeting point along the ray
};

LightSection section(const Light& light, const Ray& ray, double time_frames);

}  // namespace pagesweep
