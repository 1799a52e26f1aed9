// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/sim/crumpled_sheet.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <utility>

namespace pagesweep::sim {
namespace {

constexpr double degree = std::numbers::pi / 180;

const CrumpledSheet& sheet() {
  static const CrumpledSheet sheet(190, 270, {.folds = 12, .steepest_rad = 28 * degree, .roughness_mm = 4, .seed = 5});
  return sheet;
}

/// Length on the crumpled sheet of a straight line on the paper, from chords.
double length_of(const Eigen::Vector2d& from, const Eigen::Vector2d& to, int chords) {
  double length = 0;
  Eigen::Vector3d before = sheet().at(from.x(), from.y());
  for (int k = 1; k <= chords; ++k) {
    const Eigen::Vector2d spot = from + (to - from) * k / chords;
    const Eigen::Vector3d here = sheet().at(spot.x(), spot.y());
    length += (here - before).norm();
    before = here;
  }
  return length;
}

// A chord across a crease is shorter than the line by a share of itself: half as long chords lose half as much, and
// what chords of no length would lose is what the sheet itself is short of. Where in a chord a crease lies is chance:
// with chords of 0.015 mm that leaves some 0.002 mm.
TEST(CrumpledSheet, KeepsTheLengthOfEveryLine) {
  EXPECT_EQ(sheet().folds(), 12);
  for (double at = 5; at < 190; at += 20)
    for (const auto& [from, to] : {std::pair(Eigen::Vector2d(at, 3), Eigen::Vector2d(190 - at, 267)),
                                   std::pair(Eigen::Vector2d(1, at), Eigen::Vector2d(188, 1.3 * at))}) {
      const double true_length = (to - from).norm();
      const double coarse = length_of(from, to, 10000), fine = length_of(from, to, 20000);
      EXPECT_LE(fine, true_length + 1e-9);
      EXPECT_NEAR(2 * fine - coarse, true_length, 5e-3) << at;
    }
}

TEST(CrumpledSheet, IsAsSteepAndAsRoughAsAskedFor) {
  int steep = 0, level = 0, count = 0;
  double lowest = 1e9, highest = -1e9;
  for (double t = 1; t < 269; t += 1.7)
    for (double s = 1; s < 189; s += 1.7) {
      const double h = 1e-3;
      const Eigen::Vector3d right = sheet().at(s + h, t) - sheet().at(s, t),
                            down = sheet().at(s, t + h) - sheet().at(s, t);
      const double slope = std::acos(down.cross(right).normalized().z());
      steep += slope > 20 * degree;
      level += slope < 5 * degree;
      EXPECT_LT(slope, 45 * degree);
      lowest = std::min(lowest, sheet().at(s, t).z());
      highest = std::max(highest, sheet().at(s, t).z());
      ++count;
    }
  EXPECT_GT(steep, 0.03 * count) << "slopes near the steepest occur";
  EXPECT_LT(level, 0.5 * count);
  EXPECT_GT(lowest, -1);
  EXPECT_GT(highest, 6);
  EXPECT_LT(highest, 30);
}

// As a mesh of 0.2 mm it is rendered. What its chords lose must be far below the goal for such a page, 0.15 mm rms.
TEST(CrumpledSheet, LosesLittleToTheChordsOfAMesh) {
  double lost = 0, total = 0;
  for (double t = 4; t < 270; t += 13) {
    lost += 190 - length_of({0, t}, {190, t}, 950);
    total += 190;
  }
  EXPECT_GT(lost, 0);
  EXPECT_LT(lost / total, 4e-4);
}

}  // namespace
}  // namespace pagesweep::sim
