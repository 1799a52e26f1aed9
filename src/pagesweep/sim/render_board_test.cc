// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/sim/render_board.h"

#include <gtest/gtest.h>

#include "pagesweep/sim/board_series.h"
#include "pagesweep/sim/viewpoint.h"

namespace pagesweep::sim {
namespace {

Camera camera_above() {
  Camera camera;
  camera.width = 200, camera.height = 160;
  camera.fx = camera.fy = 400;
  camera.cx = 99.5, camera.cy = 79.5;
  camera.cam_from_rig = looking_at({0, 0, 400}, {0, 0, 0});  // a pixel is 1 mm
  return camera;
}

BoardRenderOptions noiseless() {
  BoardRenderOptions options;
  options.sensor.noisy = false;
  options.falloff = 0;
  return options;
}

/// Light is conserved: what a black square takes away is its area, wherever its edges fall on the pixels.
TEST(RenderBoard, ASquareDarkensByItsArea) {
  BoardDrawing square{40, 40, {{0, 0, 40, 40}}, {}}, nothing{40, 40, {}, {}};
  const Rigid3 place{Eigen::Matrix3d::Identity(), {-20.3, -19.6, 0}};
  const auto sum = [&](const BoardDrawing& drawing) {
    const Image<std::uint8_t> image =
        render_board({&drawing, {1, 1}, place, {}}, Scanner(camera_above()), noiseless(), 1);
    double total = 0;
    for (const std::uint8_t pixel : image.pixels()) total += pixel;
    return total;
  };
  const BoardRenderOptions options = noiseless();
  const double black_step = options.exposure * (1 - options.black / options.white) * (255 - options.sensor.black_level);
  // All black pixels have the same value, and all white ones: each kind is rounded by up to half a gray value.
  EXPECT_NEAR((sum(nothing) - sum(square)) / black_step, 40 * 40, 40 * 40 / black_step);
}

TEST(RenderBoard, ASymmetricalSquareGivesASymmetricalPicture) {
  BoardDrawing square{40, 40, {{10, 10, 20, 20}}, {}};
  const Rigid3 place{Eigen::Matrix3d::Identity(), {-20, -20, 0}};
  const Image<std::uint8_t> image = render_board({&square, {1, 1}, place, {}}, Scanner(camera_above()), noiseless(), 1);
  for (int y = 0; y < image.height(); ++y)
    for (int x = 0; x < image.width() / 2; ++x)
      ASSERT_NEAR(image(x, y), image(image.width() - 1 - x, y), 2) << x << ", " << y;
}

TEST(BoardPoses, TheFirstLiesOnTheTableAndNoneSinksIntoIt) {
  const Eigen::Vector2d size(240, 165);
  const auto poses = board_poses(size, {160, 100}, 60, 30, 5);
  EXPECT_EQ(poses[0].rotation, Eigen::Matrix3d::Identity());
  EXPECT_EQ(poses[0].translation.z(), 0);
  for (const Rigid3& pose : poses)
    for (const double x : {0.0, size.x()})
      for (const double y : {0.0, size.y()}) EXPECT_GE((pose * Eigen::Vector3d(x, y, 0)).z(), -1e-9);
}

TEST(MakeSkewedScanner, SeesTheWholeTable) {
  for (const ScannerModel model : {ScannerModel::brown_conrady, ScannerModel::pushbroom, ScannerModel::rotating_line}) {
    const Scanner scanner = make_skewed_scanner(model, 100);
    for (const double x : {-150.0, 150.0})
      for (const double y : {-110.0, 110.0}) {
        const auto pixel = scanner.project({x, y, 0});
        ASSERT_TRUE(pixel) << name_of(model);
        EXPECT_TRUE(scanner.sees(*pixel)) << name_of(model) << " " << pixel->transpose();
      }
  }
}

}  // namespace
}  // namespace pagesweep::sim
