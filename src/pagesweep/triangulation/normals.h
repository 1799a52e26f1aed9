// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/camera/ray_table.h"
#include "pagesweep/data/pixel_set.h"
#include "pagesweep/data/point_map.h"

namespace pagesweep {

/// Fits a plane to the neighbourhood of every point: fills in the normals, towards the camera, and marks as off_surface
/// the points that stand alone or away from what surrounds them.
///
/// A plane m . X = 1 in the camera's frame is seen at inverse depth 1/Z = m . (X/Z, Y/Z, 1), which over a few pixels is
/// linear in column and row: a least squares fit to the (2 radius_px + 1)^2 pixels around. Neighbours that miss it by
/// more than three times the median do not count in a second fit: another surface behind an edge. A point is off the
/// surface if fewer than six neighbours have points, or if it misses the plane by more than six of its own standard
/// deviations and six times the median.
/// \param only  points that get one; null: all
void fit_normals(PointMap& points, const RayTable& camera, int radius_px = 3, const PixelSet* only = nullptr);

}  // namespace pagesweep
