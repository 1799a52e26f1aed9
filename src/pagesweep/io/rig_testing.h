// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <string>

#include "pagesweep/camera/rig.h"

namespace pagesweep::test {

inline Eigen::Matrix3d some_rotation(double angle_rad) {
  return Eigen::AngleAxisd(angle_rad, Eigen::Vector3d(1, 2, -3).normalized()).toRotationMatrix();
}

/// Two cameras, no two numbers of which are the same, and none of which is round.
inline Rig two_cameras() {
  Rig rig;
  rig.cameras = {{"cam1", 2048, 1500, 7211.3125, 7209.6, 1019.4, 733.2, {-0.11, 0.31, 6e-4, -4e-4, 0}, {}},
                 {"cam2", 2048, 1500, 7198.875, 7195.1, 1030.7, 741.9, {-0.12, 0.35, -3e-5, 2e-4, 0}, {}}};
  rig.cameras[0].cam_from_rig = {some_rotation(3.01), {-51.2, 7.3, 702.9}};
  rig.cameras[1].cam_from_rig = {some_rotation(2.83), {48.7, 5.1, 711.4}};
  return rig;
}

/// \param tolerance  of every number: what double precision leaves of a composed pose
inline void expect_near(const Camera& a, const Camera& b, double tolerance = 1e-9) {
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(std::pair(a.width, a.height), std::pair(b.width, b.height));
  const auto numbers = [](const Camera& c) {
    const BrownConrady& d = c.distortion;
    return Eigen::Vector<double, 9>(c.fx, c.fy, c.cx, c.cy, d.k1, d.k2, d.p1, d.p2, d.k3);
  };
  EXPECT_LT((numbers(a) - numbers(b)).cwiseAbs().maxCoeff(), tolerance);
  EXPECT_LT((a.cam_from_rig.rotation - b.cam_from_rig.rotation).cwiseAbs().maxCoeff(), tolerance);
  EXPECT_LT((a.cam_from_rig.translation - b.cam_from_rig.translation).cwiseAbs().maxCoeff(), tolerance);
}

inline void expect_near(const Rig& a, const Rig& b) {
  ASSERT_EQ(a.cameras.size(), b.cameras.size());
  for (std::size_t i = 0; i < a.cameras.size(); ++i) expect_near(a.cameras[i], b.cameras[i]);
}

/// What is changed in a sound file, and what the message then has to say.
struct Damage {
  std::string from, to;
  std::string place;
  std::string hint;
};

}  // namespace pagesweep::test
