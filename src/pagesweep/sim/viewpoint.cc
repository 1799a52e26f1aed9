// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/sim/viewpoint.h"

#include <Eigen/Geometry>

namespace pagesweep::sim {

Rigid3 looking_at(const Eigen::Vector3d& center, const Eigen::Vector3d& target, double roll_rad) {
  const Eigen::Vector3d forward = (target - center).normalized();
  const Eigen::Vector3d down = forward.cross(Eigen::Vector3d::UnitX()).normalized();
  Rigid3 cam_from_rig;
  cam_from_rig.rotation.row(0) = down.cross(forward);
  cam_from_rig.rotation.row(1) = down;
  cam_from_rig.rotation.row(2) = forward;
  cam_from_rig.rotation = Eigen::AngleAxisd(roll_rad, Eigen::Vector3d::UnitZ()) * cam_from_rig.rotation;
  cam_from_rig.translation = -cam_from_rig.rotation * center;
  return cam_from_rig;
}

}  // namespace pagesweep::sim
