// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/surfacing/flatten.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace pagesweep {
namespace {

/// A start that is wrong by some percent everywhere.
Image<Eigen::Vector2d> rough_start(const Sheet& sheet, double spacing_mm) {
  Image<Eigen::Vector2d> start(sheet.columns, sheet.rows, Eigen::Vector2d::Zero());
  for (int j = 0; j < sheet.rows; ++j)
    for (int i = 0; i < sheet.columns; ++i)
      start(i, j) = spacing_mm * Eigen::Vector2d(i + 0.4 * std::sin(0.3 * j), -j + 0.3 * std::cos(0.5 * i));
  return start;
}

double distance(const Image<Eigen::Vector2d>& flat, int i0, int j0, int i1, int j1) {
  return (flat(i0, j0) - flat(i1, j1)).norm();
}

TEST(Flatten, UnrollsACylinderAboutASlantingAxis) {
  // Parameters are arc length and height, 5 mm apart, on a cylinder of 40 mm radius that leans by 20 degrees.
  const double radius = 40, lean = 0.35;
  const Sheet sheet{20, 30, [&](double i, double j) {
                      const double angle = (5 * i - 50) / radius, h = 5 * j;
                      return Eigen::Vector3d(radius * std::sin(angle),
                                             h * std::cos(lean) - radius * std::cos(angle) * std::sin(lean),
                                             h * std::sin(lean) + radius * std::cos(angle) * std::cos(lean));
                    }};
  Distortion distortion;
  const auto flat = flatten(sheet, rough_start(sheet, 5), &distortion);
  // Quartic in (spacing / 4) / radius: 1e-8
  EXPECT_LT(distortion.largest, 1e-7);
  EXPECT_NEAR(distance(flat, 0, 0, 19, 0), 95, 1e-4);
  EXPECT_NEAR(distance(flat, 0, 0, 0, 29), 145, 1e-4);
  EXPECT_NEAR(distance(flat, 0, 29, 19, 0), std::hypot(95, 145), 1e-4);
  const Eigen::Vector2d right = flat(19, 0) - flat(0, 0), up = flat(0, 29) - flat(0, 0);
  EXPECT_LT(right.x() * up.y() - right.y() * up.x(), 0) << "oriented as the start, which is mirrored against (i, j)";
}

TEST(Flatten, UnrollsAConeHoweverTheStartIsTurned) {
  // Apex angle such that the cone becomes a sector: distance from the apex r, angle in the plane phi sin(opening).
  const double opening = 0.5;
  const Sheet sheet{25, 25, [&](double i, double j) {
                      const double r = 100 + 4 * j, phi = (i - 12) * 0.05;
                      return Eigen::Vector3d(r * std::sin(opening) * std::sin(phi), r * std::cos(opening),
                                             r * std::sin(opening) * std::cos(phi));
                    }};
  const double sector = 24 * 0.05 * std::sin(opening);
  for (const double turn : {0.0, 0.8, 0.5 * std::numbers::pi, 3.0}) {
    Image<Eigen::Vector2d> start(25, 25, Eigen::Vector2d::Zero());
    for (int j = 0; j < 25; ++j)
      for (int i = 0; i < 25; ++i)
        start(i, j) = Eigen::Rotation2Dd(turn) * Eigen::Vector2d((i - 12) * 3.0, 100 + 4.0 * j);
    const auto flat = flatten(sheet, start);
    // Edges are measured along circles instead of straight lines: (0.05 sin(opening))^2 / 24 = 2.4e-5 longer.
    EXPECT_NEAR(distance(flat, 0, 24, 24, 24), 2 * 196 * std::sin(sector / 2), 0.01);
    EXPECT_NEAR(distance(flat, 0, 0, 24, 0), 2 * 100 * std::sin(sector / 2), 0.01);
    EXPECT_NEAR(distance(flat, 3, 0, 3, 24), 96, 0.01);
  }
}

TEST(Flatten, SpreadsTheErrorOfADomeAndReportsIt) {
  // A sphere of 300 mm radius, 100 x 100 mm of it: its lengths disagree by some (50 / 300)^2 / 6 = 5e-3.
  const Sheet sheet{21, 21, [](double i, double j) {
                      const double x = 5 * (i - 10), y = 5 * (j - 10);
                      return Eigen::Vector3d(x, y, std::sqrt(300.0 * 300 - x * x - y * y));
                    }};
  Distortion distortion;
  flatten(sheet, rough_start(sheet, 5), &distortion);
  EXPECT_GT(distortion.rms, 2e-4);
  EXPECT_LT(distortion.largest, 1e-2);
}

TEST(Flatten, RefusesAStartOfAnotherSize) {
  const Sheet sheet{3, 3, [](double i, double j) { return Eigen::Vector3d(i, j, 0); }};
  EXPECT_THROW(flatten(sheet, Image<Eigen::Vector2d>(3, 2, Eigen::Vector2d::Zero())), std::invalid_argument);
}

TEST(InterpolateNodes, ReproducesAParaboloidInsideAndGoesOnStraight) {
  Image<double> nodes(7, 5);
  const auto f = [](double x, double y) { return 1 + 2 * x - y + 0.5 * x * x - 0.3 * x * y + 0.1 * y * y; };
  for (int j = 0; j < 5; ++j)
    for (int i = 0; i < 7; ++i) nodes(i, j) = f(i, j);
  EXPECT_NEAR(interpolate_nodes(nodes, 3.3, 2.4), f(3.3, 2.4), 1e-12);
  EXPECT_NEAR(interpolate_nodes(nodes, 6, 4), f(6, 4), 1e-12);
  EXPECT_NEAR(interpolate_nodes(nodes, 8, 2), f(6, 2) + 2 * (f(6, 2) - f(5, 2)), 1e-12);
  EXPECT_NEAR(interpolate_nodes(nodes, -1, 2), 2 * f(0, 2) - f(1, 2), 1e-12);
}

TEST(InterpolateNodes, KnowsItsDerivativesInsideAtTheBorderAndBeyond) {
  Image<Eigen::Vector2d> nodes(7, 5);
  for (int j = 0; j < 5; ++j)
    for (int i = 0; i < 7; ++i) nodes(i, j) = {i + 0.2 * std::sin(j), j + 0.1 * i * j + 0.3 * std::cos(i)};
  constexpr double h = 1e-6;
  for (const Eigen::Vector2d& at : {Eigen::Vector2d(3.3, 2.4), {0.4, 0.2}, {5.7, 3.9}, {-1.2, 2.5}, {3.5, 6.1}}) {
    const InterpolatedNode node = differentiate_nodes(nodes, at.x(), at.y());
    const auto f = [&](double di, double dj) { return interpolate_nodes(nodes, at.x() + di, at.y() + dj); };
    EXPECT_LT((node.value - f(0, 0)).norm(), 1e-12);
    EXPECT_LT((node.jacobian.col(0) - (f(h, 0) - f(-h, 0)) / (2 * h)).norm(), 1e-8);
    EXPECT_LT((node.jacobian.col(1) - (f(0, h) - f(0, -h)) / (2 * h)).norm(), 1e-8);
  }
}

}  // namespace
}  // namespace pagesweep
