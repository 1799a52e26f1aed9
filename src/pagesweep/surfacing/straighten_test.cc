// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/surfacing/straighten.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <numbers>

namespace pagesweep {
namespace {

constexpr double degree = std::numbers::pi / 180;

std::vector<Eigen::Vector2d> sheet_turned_by(double angle_rad, bool torn = false) {
  std::vector<Eigen::Vector2d> places;
  for (int y = 0; y <= 60; ++y)
    for (int x = 0; x <= 90; ++x)
      if (!torn || x + y < 130) places.push_back(Eigen::Rotation2Dd(angle_rad) * Eigen::Vector2d(x + 30, y - 10));
  return places;
}

TEST(Askew, IsTheSheetsAngle) {
  for (const double angle : {-44.0, -20.0, -0.5, 0.0, 3.0, 12.0, 44.0})
    EXPECT_NEAR(askew_rad(sheet_turned_by(angle * degree)), angle * degree, 1e-9) << angle;
}

TEST(Askew, IsNeverMoreThanAnEighthOfATurn) {
  EXPECT_NEAR(askew_rad(sheet_turned_by(60 * degree)), -30 * degree, 1e-9);
  EXPECT_NEAR(askew_rad(sheet_turned_by(-170 * degree)), 10 * degree, 1e-9);
}

TEST(Askew, ATornCornerMakesNoDifference) {
  EXPECT_NEAR(askew_rad(sheet_turned_by(25 * degree, true)), 25 * degree, 1e-9);
}

TEST(Askew, WhatIsNotRectangularHasNone) {
  std::vector<Eigen::Vector2d> disk;
  for (int k = 0; k < 360; ++k) disk.push_back(Eigen::Rotation2Dd(k * degree) * Eigen::Vector2d(50, 0));
  EXPECT_EQ(askew_rad(disk), 0);
  EXPECT_EQ(askew_rad({}), 0);
}

}  // namespace
}  // namespace pagesweep
