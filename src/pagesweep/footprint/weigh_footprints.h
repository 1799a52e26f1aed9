// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/base/image.h"
#include "pagesweep/camera/scanner.h"
#include "pagesweep/data/point_map.h"
#include "pagesweep/data/spot_offsets.h"

namespace pagesweep {

/// The spots' middles as the scan tells them: the scanner's picture has several pixels in the spot of paper that a
/// matrix camera's pixel sees, and a first measurement tells where they are. What is found is
///     sum(w a d) / sum(w a)
/// over places d around the pixel's centre [px], with a the light that the scan found there and w a Gaussian.
/// See docs/derivations/edges.md.
/// Where the scan around a place shows too little contrast to move the middle by 0.02 px, it is 0.
/// \param light  of the scan, from linear_light()
/// \param spot_variance_px2  of the camera's point spread function and pixel, along each axis
/// \return  NaN where the camera has no point or the scanner does not see it. What the scanner sees of a spot that
/// something hides from it is wrong; fit_edges() finds out
/// \throws std::invalid_argument  if the light is not of the scanner's size or the variance not above 0
SpotOffsets weigh_footprints(const PointMap& points, const Scanner& scanner, const Image<float>& light,
                             double spot_variance_px2);

}  // namespace pagesweep
