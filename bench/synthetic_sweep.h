// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "pagesweep/camera/ray_table.h"
#include "pagesweep/camera/rig.h"
#include "pagesweep/data/frames.h"
#include "pagesweep/data/point_map.h"
#include "pagesweep/data/time_map.h"

namespace pagesweep::bench {

/// Two cameras over a tilted, curved page, made without rendering: what each pixel sees is a formula.
struct SyntheticScene {
  Rig rig;
  std::vector<PointMap> points;  ///< the truth, one map a camera
};

/// \param side_px  of the square pictures: the middle of what cameras of 1024 x 1024 would see, so that a picture of
///                 another size has more pixels and not finer ones
SyntheticScene make_scene(int side_px);

/// Both cameras' viewing rays.
std::vector<RayTable> rays_of(const SyntheticScene& scene);

/// How the stripe passes over the scene.
struct Sweep {
  int count = 200;                   ///< frames for the whole page
  int after = 0;                     ///< frames that follow
  double stripe_sigma_share = 0.02;  ///< standard deviation of the stripe, of the sweep
  int frames() const { return count + after; }
  double sigma_frames() const { return stripe_sigma_share * count; }
};

/// 8 bit frames of both cameras: a Gaussian bell at each pixel, of an amplitude that varies smoothly from 60 to 220
/// gray values, with shot noise, read noise and rounding.
struct SyntheticFrames {
  Light light;                 ///< where the stripe is at frame i
  std::vector<TimeMap> truth;  ///< exact times and amplitudes
  std::vector<Frames> frames;
};
SyntheticFrames sweep_over(const SyntheticScene& scene, const Sweep& sweep);

/// 8 bit frames of both cameras under `count` random waves of light, for the sequence matcher.
std::vector<Frames> project_waves(const SyntheticScene& scene, int count);

/// The time values' rms error over the Cramer-Rao bound of the same pixels, by every 61st pixel. An error that all have
/// in common is left out: it cancels between cameras.
double error_over_bound(const SyntheticFrames& sweep, const Sweep& settings, const std::vector<TimeMap>& measured);

/// The points' rms distance from the truth [mm].
double rms_error_mm(const PointMap& points, const PointMap& truth);

/// A source of copies of these frames, made now: reading them then costs nothing.
std::unique_ptr<FrameSource> source_of(const std::vector<Frames>& frames);

}  // namespace pagesweep::bench
