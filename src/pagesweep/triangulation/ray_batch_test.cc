// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

#include "pagesweep/base/instruction_sets_testing.h"
#include "pagesweep/sim/analytic_scene.h"
#include "pagesweep/triangulation/ray_batch_internal.h"

namespace pagesweep {
namespace {

class RayBatchTest : public testing::Test {
 protected:
  RayBatchTest() {
    from.distortion = {-0.11, 0.04, 8e-4, -5e-4, 0.02};
    to.distortion = {-0.09, 0.03, -6e-4, 7e-4, -0.01};
  }

  Rig rig = sim::make_test_rig(160);
  Camera& from = rig.cameras[0];
  Camera& to = rig.cameras[1];
};

TEST_F(RayBatchTest, RaysThroughAPointMeetThereAndItsPictureMovesAsTheProjectionSays) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> across(-100, 100), up(0, 60);
  RayBatch rays;
  std::vector<Eigen::Vector3d> points;
  for (rays.count = 0; rays.count < 61; ++rays.count) {
    const Eigen::Vector3d& point = points.emplace_back(across(random), across(random), up(random));
    const Eigen::Vector3d first = from.cam_from_rig * point, second = to.cam_from_rig * point;
    rays.first_x[rays.count] = first.x() / first.z();
    rays.first_y[rays.count] = first.y() / first.z();
    rays.second_x[rays.count] = second.x() / second.z();
    rays.second_y[rays.count] = second.y() / second.z();
  }
  on_every_instruction_set([&] {
    intersect(RayPair(from, to), rays);
    for (std::size_t k = 0; k < rays.count; ++k) {
      const Eigen::Vector3d found(rays.x[k], rays.y[k], rays.z[k]), in_to = to.cam_from_rig * points[k];
      const Eigen::Vector3d along = (points[k] - from.center()).normalized();
      EXPECT_LT((found - points[k]).norm(), 1e-9);
      EXPECT_NEAR(rays.depth[k], (from.cam_from_rig * points[k]).z(), 1e-9);
      EXPECT_LT(rays.gap_px[k], 1e-9);
      EXPECT_NEAR(rays.radius_squared[k], in_to.head<2>().squaredNorm() / (in_to.z() * in_to.z()), 1e-12);
      EXPECT_NEAR(rays.pixels_per_mm[k], (to.project_jacobian(points[k]) * along).norm(), 1e-9);
    }
  });
}

TEST_F(RayBatchTest, TheGapIsWhatTheOtherCameraSeesOfIt) {
  const Eigen::Vector3d point(10, -20, 30), along = (point - from.center()).normalized();
  const Eigen::Vector3d across = along.cross(point - to.center()).normalized();  // of both rays
  constexpr double gap_mm = 2;
  const Eigen::Vector3d beside = point + gap_mm * across;
  const Eigen::Vector3d first = from.cam_from_rig * point, second = to.cam_from_rig * beside;
  RayBatch rays;
  rays.count = 1;
  rays.first_x[0] = first.x() / first.z(), rays.first_y[0] = first.y() / first.z();
  rays.second_x[0] = second.x() / second.z(), rays.second_y[0] = second.y() / second.z();
  on_every_instruction_set([&] {
    intersect(RayPair(from, to), rays);
    // Seen from aside, the shortest way between the rays is shorter by the cosine of an angle of 2 mm in 600.
    EXPECT_NEAR(rays.gap_px[0], gap_mm * to.fx / (point - to.center()).norm(), 1e-4 * rays.gap_px[0]);
  });
}

TEST_F(RayBatchTest, RaysThatArePartingOrParallelDoNotMeet) {
  to = from;
  to.cam_from_rig.translation.x() -= 100;
  RayBatch rays;
  rays.count = 3;
  rays.second_x = {-0.2, 0.2, 0};  // the camera to the right looks left, right, straight on
  on_every_instruction_set([&] {
    intersect(RayPair(from, to), rays);
    EXPECT_NEAR(rays.depth[0], 500, 1e-9);
    EXPECT_TRUE(std::isnan(rays.depth[1]));
    EXPECT_TRUE(std::isnan(rays.depth[2]));
  });
}

}  // namespace
}  // namespace pagesweep
