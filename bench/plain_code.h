// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/base/image.h"
#include "pagesweep/camera/ray_table.h"
#include "pagesweep/data/correspondences.h"
#include "pagesweep/data/frames.h"
#include "pagesweep/data/point_map.h"
#include "pagesweep/data/time_map.h"
#include "pagesweep/matching/epipolar_curve.h"
#include "pagesweep/timing/sensor_noise.h"
#include "pagesweep/timing/stripe_profile.h"

/// The stations as one would write them down first: one pixel after the other, in doubles, on one thread, with neither
/// tables nor vectors. What the library's own are measured against.
namespace pagesweep::bench::plain {

/// Gathers each pixel's sequence, and fits a bell around its highest sample (fit_bell()).
TimeMap estimate_times(const Frames& frames, const StripeProfile& profile, const SensorNoise& noise);

/// Walks each pixel's epipolar curve, a pixel a step, until the other camera's time passes the wanted one, and
/// interpolates. Both ways must agree within half a pixel.
/// \return for the pixels of `first`
Correspondences match_times(const TimeMap& first, const TimeMap& second, const RayTable& first_camera,
                            const RayTable& second_camera, InverseDepthRange depths);

/// Compares each pixel's whole sequence, a gain and an offset free, with those at all places of its epipolar curve, and
/// fits a parabola to the highest correlation. Both ways must agree within half a pixel.
/// \return for the pixels of `first`
Correspondences match_sequences(const Frames& first, const Frames& second, const RayTable& first_camera,
                                const RayTable& second_camera, InverseDepthRange depths);

/// The point of each pixel's viewing ray nearest to its match's viewing ray.
PointMap triangulate(const Correspondences& matches, const RayTable& from, const RayTable& to);

}  // namespace pagesweep::bench::plain
