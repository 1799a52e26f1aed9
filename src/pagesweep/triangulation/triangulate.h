// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/base/image.h"
#include "pagesweep/camera/ray_table.h"
#include "pagesweep/data/correspondences.h"
#include "pagesweep/data/pixel_set.h"
#include "pagesweep/data/point_map.h"

namespace pagesweep {

struct TriangulationOptions {
  double max_ray_gap_px = 1.0;
  double near_mm = 0;
  double far_mm = 0;
  int normal_radius_px = 3;

  template <class Visitor>
  void describe(Visitor&& visit) {
    visit("max-ray-gap", max_ray_gap_px, "px",
          "the two viewing rays of a point may pass each other as far as this many pixels of the other camera see");
    visit("min-depth", near_mm, "mm", "points nearer along the camera's optical axis are dropped; 0: no limit");
    visit("max-depth", far_mm, "mm", "points farther along the camera's optical axis are dropped; 0: no limit");
    visit("normal-radius", normal_radius_px, "px", "normals are fitted to the points this near in rows and columns");
  }
};

/// Intersects the viewing rays of corresponding pixels.
///
/// A pixel's point lies on its own viewing ray, where the other camera's ray passes nearest. sigma is the match's sigma
/// over the speed [px/mm] at which the point's picture moves in the other camera when it slides along the ray. A pixel
/// without a match keeps its status. Normals are left to fit_normals().
/// \param matches    for each pixel of `from`, the place in `to`
/// \param intensity  copied to the points; of `from`'s size, or empty
/// \throws std::invalid_argument  if matches or intensity are not of `from`'s size
PointMap triangulate(const Correspondences& matches, const Image<float>& intensity, const RayTable& from,
                     const RayTable& to, const TriangulationOptions& options = {});

/// The same for some pixels, whose points and status it enters. Intensities are left alone.
/// \param only  null: all
void triangulate(const Correspondences& matches, const RayTable& from, const RayTable& to,
                 const TriangulationOptions& options, PointMap& points, const PixelSet* only);

}  // namespace pagesweep
