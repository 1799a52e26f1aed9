// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

namespace pagesweep {

/// A rotation, then a translation. `a_from_b` takes coordinates of frame b to frame a, so that chains read
/// a_from_c = a_from_b * b_from_c.
struct Rigid3 {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();  ///< [mm]

  Eigen::Vector3d operator*(const Eigen::Vector3d& point) const { return rotation * point + translation; }
  Rigid3 operator*(const Rigid3& other) const {
    return {rotation * other.rotation, rotation * other.translation + translation};
  }
  Rigid3 inverse() const { return {rotation.transpose(), -(rotation.transpose() * translation)}; }
};

/// A half line in the rig frame.
struct Ray {
  Eigen::Vector3d origin;     ///< [mm]
  Eigen::Vector3d direction;  ///< unit length

  Eigen::Vector3d at(double distance_mm) const { return origin + distance_mm * direction; }
};

using Matrix23d = Eigen::Matrix<double, 2, 3>;

}  // namespace pagesweep
