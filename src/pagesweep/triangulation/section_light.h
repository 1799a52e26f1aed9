// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/camera/light.h"
#include "pagesweep/data/point_map.h"
#include "pagesweep/data/time_map.h"
#include "pagesweep/triangulation/triangulate.h"

namespace pagesweep {

/// Points from one camera alone, by light sectioning (the paper's [8]): each pixel's viewing ray meets the sheet of
/// light as it stood at the pixel's time value. sigma is that of the time value times the speed at which the meeting
/// point slides along the ray; an error of the light's own calibration is not in it.
/// Status: that of the time map; rays_miss where the ray does not meet the sheet; outside_depth. Normals are left to
/// fit_normals().
/// \throws std::invalid_argument  if the map's size is not the camera's
PointMap section_light(const TimeMap& times, const RayTable& camera, const Light& light,
                       const TriangulationOptions& options = {});

}  // namespace pagesweep
