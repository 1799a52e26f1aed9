// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/calibration/light_sightings.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

namespace pagesweep {
namespace {

Camera make_camera() {
  Camera camera{"cam", 200, 160, 300, 300, 99.5, 79.5, {}, {}};
  camera.cam_from_rig.rotation << 1, 0, 0, 0, -1, 0, 0, 0, -1;
  camera.cam_from_rig.translation = {0, 0, 500};
  return camera;
}

TEST(LightSightings, LieOnTheBoardWhereTheLightIsAtTheirTime) {
  const Camera camera = make_camera();
  const Light light(TranslatingPlane{Eigen::Vector3d(0, 1, 0.2).normalized(), -100, 2});
  BoardPlace board;
  board.rig_from_board.rotation = Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitX()).toRotationMatrix();
  board.rig_from_board.translation = {10, 5, 30};
  board.lower_mm = {-60, -40};
  board.upper_mm = {60, 40};
  const Eigen::Vector3d normal = board.rig_from_board.rotation.col(2);
  TimeMap times(camera.width, camera.height);
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const auto point = Plane{normal, normal.dot(board.rig_from_board.translation)}.meet(*camera.ray({x, y}));
      ASSERT_TRUE(point);
      times.time(x, y) = static_cast<float>(*light.time_of(*point));
      times.status(x, y) = x < 90 ? PixelStatus::ok : PixelStatus::too_dark;
    }
  const auto sightings = light_sightings(times, camera, board);
  EXPECT_GT(sightings.size(), 50U);
  for (const LightSighting& seen : sightings) {
    EXPECT_NEAR(light.plane_at(seen.time).distance(seen.point), 0, 1e-4);
    const Eigen::Vector3d on_board = board.rig_from_board.inverse() * seen.point;
    EXPECT_NEAR(on_board.z(), 0, 1e-9);
    EXPECT_LE(std::abs(on_board.x()), 60);
    EXPECT_LE(std::abs(on_board.y()), 40);
  }
}

TEST(LightSightings, RefusesAMapOfAnotherSize) {
  EXPECT_THROW(light_sightings(TimeMap(10, 10), make_camera(), {}), std::invalid_argument);
}

}  // namespace
}  // namespace pagesweep
