// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/sim/obstacle.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "pagesweep/sim/paper.h"
#include "pagesweep/sim/simulate.h"

namespace pagesweep::sim {
namespace {

SheetShape make_leaf() {
  SheetShape shape;
  shape.width_mm = 100;
  shape.height_mm = 140;
  shape.at_mm = {-50, 0, 2};
  shape.slopes = {{0, 0.2}, {30, 0.05}, {60, 0}, {100, 0}};
  return shape;
}

TEST(Obstacle, AFingerTouchesThePaperWithItsEndAndRisesOutwards) {
  const GridMesh page = bend_sheet(make_leaf(), 1).mesh;
  const Obstacle finger{.s_mm = 88, .t_mm = 70, .turn_rad = 0, .length_mm = 60, .breadth_mm = 16};
  const GridMesh mesh = make_obstacle(finger, page, 1);
  double lowest = 1e9, highest = -1e9, leftmost = 1e9, rightmost = -1e9;
  for (const Eigen::Vector3d& p : mesh.positions.pixels()) {
    lowest = std::min(lowest, p.z());
    highest = std::max(highest, p.z());
    leftmost = std::min(leftmost, p.x());
    rightmost = std::max(rightmost, p.x());
  }
  const Eigen::Vector3d end = page.point(page.spot_at(88, 70));
  EXPECT_NEAR(lowest, end.z(), 0.8) << "it presses into the paper no deeper";
  EXPECT_NEAR(highest - lowest, 16 + 52 * std::sin(0.2), 1.5);
  EXPECT_NEAR(leftmost, end.x(), 0.5);
  EXPECT_NEAR(rightmost - leftmost, 60, 3);
}

TEST(Obstacle, ASlipFloatsAboveThePaperAndIsBentAsItIs) {
  const GridMesh page = bend_sheet(make_leaf(), 1).mesh;
  const Obstacle slip{ObstacleKind::slip, 1, 50, 70, 0.4, 40, 20, 1.2, 0.8};
  const GridMesh mesh = make_obstacle(slip, page, 1);
  const Eigen::Vector3d below = page.point(page.spot_at(50, 70));
  const Eigen::Vector3d middle = mesh.positions(mesh.columns() / 2, mesh.rows() / 2);
  EXPECT_NEAR((middle - below).norm(), 1.2, 0.02);
  EXPECT_GT(mesh.normals(0, 0).z(), 0.9f);
}

TEST(BendSheet, RollsUpACornerOfAPlaneWithoutStretchingIt) {
  SheetShape shape = make_leaf();
  shape.curls = {{SheetCorner::bottom_right, 30, 40}};
  const Sheet sheet = bend_sheet(shape, 0.5);
  EXPECT_LT(sheet.largest_strain, 1e-4);
  const GridMesh& mesh = sheet.mesh;
  const double rise =
      mesh.positions(mesh.columns() - 1, mesh.rows() - 1).z() - mesh.positions(mesh.columns() - 1, 0).z();
  EXPECT_NEAR(rise, 40 * (1 - std::cos(0.75)), 0.05);
}

TEST(Simulate, KnowsWhatIsCoveredTornAndBlind) {
  Scene scene;
  scene.rig = make_default_rig();
  ScenePage page;
  page.shape = make_leaf();
  page.shape.tears = {{SheetCorner::top_left, 20, 30}};
  page.print.width_mm = 100;
  page.print.height_mm = 140;
  scene.pages.push_back(page);
  scene.obstacles = {{.page = 1, .s_mm = 85, .t_mm = 70, .turn_rad = 0, .length_mm = 50, .breadth_mm = 16}};
  scene.blind_areas = {{-20, -40, 10, -10}};
  const Simulation simulation = simulate(scene, {.preview = true});
  const SimulatedPage& flat = simulation.pages[0];
  const auto fate_at = [&](double s, double t) {
    return SpotFate(flat.fates(static_cast<int>(s * flat.pixels_per_mm), static_cast<int>(t * flat.pixels_per_mm)));
  };
  EXPECT_EQ(fate_at(4, 5), SpotFate::torn);
  EXPECT_EQ(fate_at(40, 40), SpotFate::seen);
  EXPECT_EQ(fate_at(94, 70), SpotFate::covered);
  EXPECT_EQ(fate_at(75, 70), SpotFate::seen);
  for (int y = 0; y < flat.scan_map.u.height(); ++y)
    for (int x = 0; x < flat.scan_map.u.width(); ++x)
      EXPECT_EQ(std::isnan(flat.scan_map.u(x, y)), flat.fates(x, y) != std::uint8_t(SpotFate::seen));
  const auto& points = simulation.camera_points[0];
  const Image<float> brightest_sample = brightest(simulation.frames[0]);
  int blind = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!scene.blind_areas[0].contains(points.data()[i])) continue;
    ++blind;
    EXPECT_LT(brightest_sample.data()[i], 1);
  }
  EXPECT_GT(blind, 200);
}

}  // namespace
}  // namespace pagesweep::sim
