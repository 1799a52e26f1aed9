// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/drift/correct_poses.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

#include "pagesweep/base/error.h"
#include "pagesweep/sim/analytic_scene.h"

namespace pagesweep {
namespace {

/// A camera turned about its centre and moved.
Camera moved(Camera camera, const Eigen::Vector3d& turn_rad, const Eigen::Vector3d& shift_mm) {
  const Eigen::Vector3d center = camera.center() + shift_mm;
  camera.cam_from_rig.rotation =
      Eigen::AngleAxisd(turn_rad.norm(), turn_rad.normalized()) * camera.cam_from_rig.rotation;
  camera.cam_from_rig.translation = -(camera.cam_from_rig.rotation * center);
  return camera;
}

class CorrectPoses : public ::testing::Test {
 protected:
  const Rig rig = sim::make_test_rig(1024);
  const Camera& first = rig.cameras[0];
  const Camera& second = rig.cameras[1];
  // 0.05 degrees and 0.3 mm.
  const Camera drifted = moved(second, {4e-4, -5e-4, 6e-4}, {0.2, -0.1, 0.2});
  std::vector<Eigen::Vector3d> points;

  /// What is seen of a curved page. \param noise  times the standard deviations that the adjustment counts on
  std::vector<TiePoint> see(double noise, bool in_scan, unsigned seed = 1) {
    std::mt19937 random(seed);
    std::normal_distribution<double> scatter;
    const auto disturb = [&](Eigen::Vector2d& place, double sigma) {
      for (int i = 0; i < 2; ++i) place(i) += noise * sigma * scatter(random);
    };
    std::vector<TiePoint> ties;
    points.clear();
    for (double x = -120; x <= 120; x += 16)
      for (double y = -90; y <= 90; y += 16) {
        const Eigen::Vector3d point(x, y, 20 + 15 * std::sin(0.02 * x));
        TiePoint tie;
        tie.point = point + Eigen::Vector3d(0.3, -0.2, 0.5);  // as a wrong rig has it
        tie.time = *rig.light->time_of(point);
        tie.first = *first.project(point);
        disturb(tie.first, 0.03);
        tie.second = *second.project(point);
        disturb(tie.second, 0.03);
        tie.second_covariance = 1e-4 * Eigen::Matrix2d::Identity();
        if (in_scan) {
          TiePoint::InScan seen;
          seen.place = *rig.scanner->project(point);
          disturb(seen.place, 0.2);
          tie.scan = seen;
        }
        ties.push_back(tie);
        points.push_back(point);
      }
    return ties;
  }

  /// Largest error of a projection with the corrected cameras.
  double worst_px(const PoseCorrection& correction) const {
    double worst = 0;
    for (const Eigen::Vector3d& point : points) {
      worst = std::max(worst, (*correction.cameras[0].camera.project(point) - *first.project(point)).norm());
      worst = std::max(worst, (*correction.cameras[1].camera.project(point) - *second.project(point)).norm());
    }
    return worst;
  }
};

TEST_F(CorrectPoses, LeavesATrueRigAlone) {
  const PoseCorrection correction = correct_poses(see(0, true), first, second, rig);
  EXPECT_LT(worst_px(correction), 1e-3);
  EXPECT_LT(correction.cameras[1].turn_deg, 1e-4);
  EXPECT_EQ(correction.used, static_cast<int>(points.size()));
}

TEST_F(CorrectPoses, FindsACameraThatHasMoved) {
  const PoseCorrection correction = correct_poses(see(0, true), first, drifted, rig);
  // The priors pull a little.
  EXPECT_LT(worst_px(correction), 0.02);
  EXPECT_NEAR(correction.cameras[1].turn_deg, 0.05, 0.005);
  EXPECT_NEAR(correction.cameras[1].shift_mm, 0.3, 0.06);
  EXPECT_LT(correction.cameras[0].turn_deg, 0.005);
}

TEST_F(CorrectPoses, WithoutAScanWhatNothingShowsStaysAsItWas) {
  const PoseCorrection with = correct_poses(see(0, true), first, drifted, rig);
  const PoseCorrection without = correct_poses(see(0, false), first, drifted, rig);
  // Everything that is seen agrees; but along the stripe and in height both cameras together may have moved.
  EXPECT_LT(without.misfit, 0.1);
  EXPECT_LT(without.cameras[0].shift_mm + without.cameras[1].shift_mm, 0.5);
  EXPECT_GT(without.cameras[1].shift_sigma_mm, 2 * with.cameras[1].shift_sigma_mm);
}

TEST_F(CorrectPoses, ForgetsWhatDoesNotBelong) {
  auto ties = see(0, true);
  for (std::size_t i = 0; i < ties.size(); i += 9) ties[i].second.y() += 4;
  for (std::size_t i = 4; i < ties.size(); i += 9) ties[i].scan->place.x() -= 30;
  const PoseCorrection correction = correct_poses(ties, first, drifted, rig);
  EXPECT_LT(worst_px(correction), 0.03);
  EXPECT_LT(correction.used, static_cast<int>(ties.size()) * 8 / 9);
  EXPECT_GT(correction.used, static_cast<int>(ties.size()) * 6 / 9);
}

TEST_F(CorrectPoses, KnowsHowWellItKnows) {
  constexpr int runs = 40;
  double misfit = 0, turn = 0;
  for (unsigned seed = 0; seed < runs; ++seed) {
    const PoseCorrection correction = correct_poses(see(1, true, seed), first, second, rig);
    misfit += correction.misfit / runs;
    turn += std::pow(correction.cameras[1].turn_deg / correction.cameras[1].turn_sigma_deg, 2) / runs;
  }
  // 1: what is left is the noise. The noise in see() is that of one camera: less than is counted on, for the second.
  EXPECT_NEAR(misfit, 0.9, 0.15);
  // Priors are wider than what happened: errors are a little less than claimed.
  EXPECT_GT(turn, 0.4);
  EXPECT_LT(turn, 1.3);
}

TEST_F(CorrectPoses, WantsEnoughPrint) {
  const auto ties = see(0, true);
  EXPECT_THROW(correct_poses(std::span(ties).first(19), first, second, rig), Error);
}

}  // namespace
}  // namespace pagesweep
