// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "pagesweep/camera/light.h"
#include "pagesweep/data/correspondences.h"
#include "pagesweep/data/pixel_set.h"
#include "pagesweep/data/point_map.h"
#include "pagesweep/data/time_map.h"
#include "pagesweep/triangulation/triangulate.h"

namespace pagesweep {

/// How many points of one camera the sheet of light had a say in.
struct FusionCounts {
  std::int64_t weighted = 0;   ///< both cameras and the sheet agree
  std::int64_t corrected = 0;  ///< the sheet contradicts the match: the pixel's own time and the sheet count
  std::int64_t added = 0;      ///< the other camera does not see the spot, or no match was found

  FusionCounts& operator+=(const FusionCounts& more);
};

/// Makes each stereo point the weighted mean of what both cameras and the sheet of light say, and measures by light
/// sectioning what only one camera sees.
///
/// The pixel's own time takes part in both measurements; the mean respects their covariance. Where the sheet misses the
/// surface by the same in a neighbourhood of 8 pixels, it follows: light from a facing page delays both cameras
/// alike, and the match is right. A match that the sheet contradicts by more than six standard deviations lies on a
/// step in depth: the pixel's own time and the sheet replace it, or it becomes off_surface where they know too little.
/// See docs/derivations/fusion.md. Normals are left to fit_normals().
/// \param points   of `camera`, from triangulate() with these `matches` and `times`; changed
/// \param only     pixels that it is done for; null: all
/// \param stereo   points that are as triangulate() left them, those around `only` among them; null: all
/// \throws std::invalid_argument  if sizes differ
FusionCounts fuse_light(PointMap& points, const Correspondences& matches, const TimeMap& times, const RayTable& camera,
                        const Light& light, const TriangulationOptions& options = {}, const PixelSet* only = nullptr,
                        const PixelSet* stereo = nullptr);

}  // namespace pagesweep
