// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>

#include "pagesweep/camera/light.h"

namespace pagesweep {

struct Sphere {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  ///< [mm]
  double radius_mm = 0;

  /// [mm] signed, positive outside
  double distance(const Eigen::Vector3d& p) const { return (p - center).norm() - radius_mm; }
};

/// The plane with the least sum of squared distances, by the eigenvectors of the points' covariance.
/// \throws std::invalid_argument  if there are fewer than 3 points
Plane fit_plane(std::span<const Eigen::Vector3d> points);

/// The sphere with the least sum of squared distances (|p - c| - r)^2, centre and radius free, by the Gauss-Newton
/// method.
/// \param start  an estimate, within half a radius of the sphere
/// \throws std::invalid_argument  if there are fewer than 4 points
Sphere fit_sphere(std::span<const Eigen::Vector3d> points, const Sphere& start);

/// Covariance of (centre, radius) [mm^2] for points around the sphere whose distances to it are independent and have
/// the standard deviation `sigma_mm`: sigma^2 (J^T J)^-1.
Eigen::Matrix4d covariance_of(const Sphere& sphere, std::span<const Eigen::Vector3d> points, double sigma_mm);

}  // namespace pagesweep
