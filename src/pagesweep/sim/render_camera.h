// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "pagesweep/base/progress.h"
#include "pagesweep/camera/camera.h"
#include "pagesweep/data/frames.h"
#include "pagesweep/sim/bounce.h"
#include "pagesweep/sim/direct_light.h"
#include "pagesweep/sim/sensor.h"
#include "pagesweep/sim/world.h"

namespace pagesweep::sim {

/// The lit scene: what does not depend on who looks at it.
struct LitWorld {
  const World& world;
  const RayCaster& caster;
  const DirectLight& direct;
  const Bounce& bounce;
  const Stripe& stripe;
};

struct CameraOptions {
  int rays_per_side = 8;       ///< a pixel is sampled with the square of it
  double psf_sigma_px = 0.45;  ///< the lens' Gaussian point spread, on top of the pixel's own area
  double exposure = 0.83;      ///< share of the full well that a perfectly white level spot at the table's origin fills
  double ambient = 0.01;       ///< steady light, in units of the stripe's there
  int frames = 200;
  std::vector<double> exposures = {};  ///< of the frames in turn, 1: as above; empty: all 1
};

/// Renders what a camera records of the sweep. The image of a point is the lens' point spread, integrated over the
/// pixel's area, sampled in equal shares; each ray is cast once and then lit at every frame.
/// \param viewer  this camera's number among the viewers of lit.direct
/// \param seed    of the sensor's noise
Frames render_camera(const LitWorld& lit, const Camera& camera, int viewer, const CameraOptions& options,
                     const SensorModel& sensor, std::uint64_t seed, Progress& progress = no_progress());

/// Offsets [px] that cut the distribution of a pixel's area widened by a Gaussian into `count` parts of equal weight:
/// the medians of the parts, stretched to the variance of the whole.
std::vector<double> spot_offsets(int count, double psf_sigma_px);

/// Rig-frame point [mm] that each pixel's centre ray hits; NaN where it hits nothing that is measured.
Image<Eigen::Vector3f> find_camera_points(const World& world, const RayCaster& caster, const Camera& camera);

}  // namespace pagesweep::sim
