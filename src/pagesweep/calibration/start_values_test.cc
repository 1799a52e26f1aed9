// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/calibration/start_values.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "pagesweep/calibration/simulated_corners_testing.h"

namespace pagesweep {
namespace {

/// Exact points of boards in ten poses, as a scanner shows them.
ScanPoints exact_points(const Scanner& scanner) {
  const Board board = test::small_board();
  ScanPoints points{scanner.width(), scanner.height(), {}, {}};
  for (const Rigid3& pose : sim::board_poses(board.size_mm(), {160, 100}, 60, 10, 3))
    for (int corner = 0; corner < board.corner_count(); ++corner) {
      const Eigen::Vector2d place = board.corner_mm(corner);
      const Eigen::Vector3d point = pose * Eigen::Vector3d(place.x(), place.y(), 0);
      points.rig_mm.push_back(point);
      points.pixels.push_back(*scanner.project(point));
    }
  return points;
}

double worst_error(const Scanner& found, const ScanPoints& points) {
  double worst = 0;
  for (std::size_t k = 0; k < points.pixels.size(); ++k)
    worst = std::max(worst, (*found.project(points.rig_mm[k]) - points.pixels[k]).norm());
  return worst;
}

TEST(FindScanner, APushbroomIsFoundExactlyFromExactPoints) {
  auto line = std::get<Pushbroom>(sim::make_skewed_scanner(ScannerModel::pushbroom, 100).model());
  line.k1 = 0;
  const ScanPoints points = exact_points(Scanner(line));
  const auto found = find_scanner(ScannerModel::pushbroom, points);
  ASSERT_TRUE(found);
  const auto& start = std::get<Pushbroom>(*found);
  EXPECT_NEAR(start.f, line.f, 1e-4 * line.f);
  EXPECT_LT((start.center - line.center).norm(), 0.1);
  EXPECT_LT((start.step - line.step).norm(), 1e-6);
  EXPECT_LT(worst_error(Scanner(*found), points), 1e-3);
}

TEST(FindScanner, AFrameCameraIsFoundExactlyFromExactPoints) {
  auto camera = std::get<Camera>(sim::make_skewed_scanner(ScannerModel::brown_conrady, 100).model());
  camera.distortion = {};
  const ScanPoints points = exact_points(Scanner(camera));
  const auto found = find_scanner(ScannerModel::brown_conrady, points);
  ASSERT_TRUE(found);
  EXPECT_NEAR(std::get<Camera>(*found).fx, camera.fx, 1e-4 * camera.fx);
  EXPECT_LT(worst_error(Scanner(*found), points), 1e-3);
}

TEST(FindScanner, ARotatingLineIsFoundAsWellAsSmallAnglesAllow) {
  auto line = std::get<RotatingLine>(sim::make_skewed_scanner(ScannerModel::rotating_line, 100).model());
  line.k1 = 0;
  const ScanPoints points = exact_points(Scanner(line));
  const auto found = find_scanner(ScannerModel::rotating_line, points);
  ASSERT_TRUE(found);
  // tan a - a is a^3 / 3: at the table's end, 150 mm from the middle and 700 mm away, 0.0033 rad or 9 rows.
  EXPECT_LT(worst_error(Scanner(*found), points), 20);
}

TEST(FindScanner, PointsOfOnePlaneDoNotTell) {
  const Scanner scanner = sim::make_skewed_scanner(ScannerModel::pushbroom, 100);
  ScanPoints points = exact_points(scanner);
  points.rig_mm.resize(48), points.pixels.resize(48);  // the first pose alone
  for (const ScannerModel model : {ScannerModel::brown_conrady, ScannerModel::pushbroom, ScannerModel::rotating_line})
    EXPECT_FALSE(find_scanner(model, points)) << name_of(model);
}

TEST(FindScanner, AMirroredScanIsRecognised) {
  ScanPoints points = exact_points(sim::make_skewed_scanner(ScannerModel::pushbroom, 100));
  EXPECT_FALSE(is_mirrored(points));
  for (Eigen::Vector2d& pixel : points.pixels) pixel.x() = points.width - 1 - pixel.x();
  EXPECT_TRUE(is_mirrored(points));
}

TEST(FindFocalLength, IsExactWithoutDistortion) {
  const double f = 1480;
  std::vector<Eigen::Matrix3d> views;
  for (const double tilt : {0.3, 0.5, -0.4}) {
    const Eigen::Matrix3d turn = Eigen::AngleAxisd(tilt, Eigen::Vector3d(1, tilt, 0).normalized()).toRotationMatrix();
    Eigen::Matrix3d homography;
    homography << turn.leftCols<2>(), Eigen::Vector3d(10, 20, 700);
    views.push_back(Eigen::Vector3d(f, f, 1).asDiagonal() * homography);
  }
  ASSERT_TRUE(find_focal_length(views));
  EXPECT_NEAR(*find_focal_length(views), f, 1e-6 * f);
}

TEST(FindHomography, PointsOnALineDoNotTell) {
  std::vector<Eigen::Vector2d> line;
  for (int k = 0; k < 8; ++k) line.emplace_back(k, 2 * k);
  EXPECT_FALSE(find_homography(line, line));
  EXPECT_FALSE(find_homography(std::span(line).first(3), std::span(line).first(3)));
}

}  // namespace
}  // namespace pagesweep
