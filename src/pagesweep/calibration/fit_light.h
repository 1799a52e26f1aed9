// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "pagesweep/camera/light.h"

namespace pagesweep {

/// A spot of known place that the light's middle passed.
struct LightSighting {
  Eigen::Vector3d point;  ///< [mm] rig frame
  double time = 0;        ///< [frames]
};

/// The light's motion as sightings show it.
struct LightFit {
  Light light;            ///< TranslatingPlane or RotatingPlane, whichever predicts better
  bool turns = false;     ///< the second
  double rms_mm = 0;      ///< of the sightings from the plane of their time, outliers left out
  double tilt_sigma = 0;  ///< how uncertain the plane's slope against z is; near 1: the sightings do not show it
  std::size_t used = 0;   ///< sightings that are no outliers
};

/// Fits the model of the light that the rig will hold: a plane that moves evenly, or turns evenly about an axis. Each
/// is fitted robustly (Tukey's weights) to every other sighting, and what predicts the rest better by a tenth is taken,
/// the moving plane in doubt. Sightings at one height say nothing about the plane's tilt; it is then held near upright.
/// \throws Error no_result  if there are fewer than 100 sightings or they cover fewer than 10 frames
LightFit fit_light(std::span<const LightSighting> sightings);

}  // namespace pagesweep
