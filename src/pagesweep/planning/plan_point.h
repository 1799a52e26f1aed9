// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <limits>

#include "pagesweep/camera/camera.h"
#include "pagesweep/camera/light.h"

namespace pagesweep {

/// How well a spot of level paper is measured; NaN where it cannot be. All are standard deviations.
struct SpotAccuracy {
  static constexpr double missing = std::numeric_limits<double>::quiet_NaN();

  double match_px = missing;      ///< of the match along the epipolar line in the other camera
  double stereo_mm = missing;     ///< of the point along its viewing ray: two cameras
  double joint_mm = missing;      ///< likewise: two cameras and the known sheet of light, weighted as their noise wants
  double section_mm = missing;    ///< likewise: one camera and the sheet of light
  double height_share = missing;  ///< height over distance along the ray: multiply by it to have z
};

/// Share of the other camera's time variance that is left where its time map is read between four pixels: the mean of
/// the sum of squared bilinear weights, (2/3)^2.
inline constexpr double interpolated_variance = 4.0 / 9;

/// What one camera's pixel measures of a spot of level paper, from times that are uncertain by `time_sigma`.
///
/// With lambda the distance along the ray, T(lambda) the time at which the sheet of light passes the place there and
/// t2(lambda) the time that the other camera has where it sees this place, stereo solves t1 = t2(lambda),
/// a section t1 = T(lambda), and both together weigh t1 - T and t2 - T (docs/derivations/accuracy.md).
/// \param from        the camera whose pixel it is
/// \param to          the other one; nullptr: there is none
/// \param time_sigma  [frames] of both cameras' time values
/// \param spot        [mm] rig frame
/// \return            all missing if `from` does not see the spot; match, stereo and joint missing if `to` does not
SpotAccuracy plan_point(const Camera& from, const Camera* to, const Light& light, double time_sigma,
                        const Eigen::Vector3d& spot);

/// Whether a camera has the spot in its picture and looks upon it from above.
bool sees_level(const Camera& camera, const Eigen::Vector3d& spot);

/// How much later the sheet of light passes a place that lies a millimetre farther in that direction.
/// \param step  direction, of any length
/// \return      [frames/mm] times that length; NaN if the sheet never passes the spot
double time_slope(const Light& light, const Eigen::Vector3d& spot, const Eigen::Vector3d& step);

}  // namespace pagesweep
