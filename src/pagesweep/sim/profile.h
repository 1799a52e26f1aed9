// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "pagesweep/sim/paper.h"

namespace pagesweep::sim {

/// Inclination of a profile along its arc length: the monotone piecewise cubic (PCHIP, Fritsch and Carlson 1980)
/// through the given points, constant beyond them. Between equal slopes it is exactly straight.
class SlopeCurve {
 public:
  /// \param points  at least one, at_mm strictly ascending
  explicit SlopeCurve(std::vector<ProfileSlope> points);
  double slope_rad(double at_mm) const;
  double curvature(double at_mm) const;  ///< d slope / d at [rad/mm]

 private:
  std::vector<ProfileSlope> points_;
  std::vector<double> curvatures_;  ///< at the points
};

/// A curve on the unit sphere, by its arc: the rulings' directions of a cone. Starts along `ruling` and leaves it at
/// right angles, in direction `across` raised by the first slope towards `up`. Its geodesic curvature is the profile's
/// curvature at the distance of the apex; the cone over it is thus bent like the profile there, and isometric to the
/// plane.
class RulingCurve {
 public:
  /// \param apex_mm   distance of the apex
  /// \param axes      columns: ruling, across, up; orthonormal, right- or left-handed
  /// \param first_mm, last_mm  range of the profile's arc length that is needed
  RulingCurve(const SlopeCurve& slopes, double apex_mm, double first_mm, double last_mm, const Eigen::Matrix3d& axes);

  struct Direction {
    Eigen::Vector3d ruling;  ///< unit length, from the apex
    Eigen::Vector3d normal;  ///< of the cone, unit length
  };
  /// \param angle_rad  arc along the curve: the polar angle on the flat sheet about the apex
  Direction at(double angle_rad) const;

 private:
  struct Sample {
    Eigen::Vector3d ruling, across, bend;
  };
  double handedness_;
  double first_rad_ = 0, step_rad_;
  std::vector<Sample> samples_;
};

}  // namespace pagesweep::sim
