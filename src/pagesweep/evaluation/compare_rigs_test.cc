// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/evaluation/compare_rigs.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <stdexcept>

#include "pagesweep/sim/analytic_scene.h"

namespace pagesweep {
namespace {

/// The same rig, in a frame that is turned and shifted.
Rig moved(Rig rig) {
  const Rigid3 new_from_old{Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix(),
                            {10, -20, 5}};
  for (Camera& camera : rig.cameras) camera.cam_from_rig = camera.cam_from_rig * new_from_old.inverse();
  Pushbroom line = std::get<Pushbroom>(rig.scanner->model());
  line.center = new_from_old * line.center;
  line.step = new_from_old.rotation * line.step;
  line.rotation = line.rotation * new_from_old.rotation.transpose();
  rig.scanner = Scanner(line);
  return rig;
}

TEST(CompareRigs, AnotherFrameIsNoError) {
  const Rig truth = sim::make_test_rig();
  const RigComparison comparison = compare_rigs(moved(truth), truth);
  EXPECT_GT(comparison.points, 500u);
  EXPECT_LT(comparison.point_worst_mm, 1e-6);
  EXPECT_LT(comparison.scan_worst_px, 1e-5);
  EXPECT_NEAR(comparison.frame_turn_rad, 0.3, 1e-6);
}

TEST(CompareRigs, ALongerFocalLengthShowsInPointsAndAScannersShiftInTheScan) {
  const Rig truth = sim::make_test_rig();
  Rig rig = truth;
  rig.cameras[0].fx *= 1.001;
  Pushbroom line = std::get<Pushbroom>(rig.scanner->model());
  line.cx += 0.5;
  rig.scanner = Scanner(line);
  const RigComparison comparison = compare_rigs(rig, truth);
  EXPECT_GT(comparison.point_rms_mm, 0.01) << "a thousandth of the 200 mm to the middle is 0.2 mm, less the motion";
  EXPECT_LT(comparison.point_rms_mm, 0.2);
  EXPECT_GT(comparison.scan_rms_px, 0.4);
}

TEST(CompareRigs, WhatCannotBeComparedIsRefused) {
  const Rig truth = sim::make_test_rig();
  Rig other = truth;
  other.cameras[0].name = "left";
  EXPECT_THROW(compare_rigs(other, truth), std::invalid_argument);
  EXPECT_THROW(compare_rigs(truth, truth, {.lowest_mm = 5000, .highest_mm = 5100}), std::invalid_argument);
  EXPECT_THROW(compare_rigs(truth, truth, {.grid_mm = 0}), std::invalid_argument);
}

}  // namespace
}  // namespace pagesweep
