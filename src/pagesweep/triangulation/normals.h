// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/camera/camera.h"
#include "pagesweep/camera/ray_table.h"
#include "pagesweep/data/point_map.h"

namespace pagesweep {

/// Fills in the normals, towards the camera, of all points that have status ok and enough neighbours.
///
/// A plane m . X = 1 in the camera's frame is seen at inverse depth 1/Z = m . (X/Z, Y/Z, 1): linear, so m is the least
/// squares fit of inverse depth to the viewing directions of the (2 radius_px + 1)^2 pixels around. Neighbours that
/// miss the plane by more than three times the median do not count in a second fit: another surface behind an edge.
void estimate_normals(PointMap& points, const Camera& camera, const RayTable& rays, int radius_px);

}  // namespace pagesweep
