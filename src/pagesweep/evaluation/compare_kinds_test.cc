// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/evaluation/compare_kinds.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "pagesweep/sim/analytic_scene.h"

namespace pagesweep {
namespace {

/// A flat page with a dark square, measured with an error that is known for each kind of pixel.
struct KnownErrors {
  Rig rig = sim::make_test_rig(160);
  const Camera& camera = rig.cameras[0];
  PointMap points = sim::AnalyticScene{[](double, double) { return 10.0; }}.points(camera, 0.05);
  TimeMap times = TimeMap(160, 160);
  TruePoints truth = TruePoints(160, 160, Eigen::Vector3f::Constant(not_a_number));
  Image<float> distances = Image<float>(160, 160, not_a_number);

  static bool in_square(int x, int y, int grow) {
    return x >= 60 - grow && x < 80 + grow && y >= 60 - grow && y < 80 + grow;
  }

  KnownErrors() {
    std::mt19937 random(1);
    std::normal_distribution<float> normal;
    for (int y = 0; y < 160; ++y)
      for (int x = 0; x < 160; ++x) {
        if (points.status(x, y) != PixelStatus::ok) continue;
        truth(x, y) = {points.x(x, y), points.y(x, y), points.z(x, y)};
        times.amplitude(x, y) = in_square(x, y, 0) ? 20 : 180;
        times.sigma(x, y) = 0.02f;
        times.status(x, y) = PixelStatus::ok;
        distances(x, y) = (in_square(x, y, 3) ? 0.2f : 0.05f) * normal(random);
      }
  }
  KindView view() const { return {&camera, &points, &times, &truth, &distances}; }
};

TEST(CompareKinds, TellsPrintFromBlankPaper) {
  const KnownErrors known;
  const KindView view = known.view();
  const auto half_a_claim = [](double) { return 0.01; };
  const KindComparison kinds = compare_kinds({&view, 1}, {}, {}, half_a_claim);
  EXPECT_NEAR(kinds.blank.distance.rms, 0.05, 0.002);
  EXPECT_NEAR(kinds.print.distance.rms, 0.2, 0.02);
  EXPECT_NEAR(kinds.bright_print.distance.rms, 0.2, 0.04);
  // The dark square with one pixel of edge and two around, but for its corners, which no row or column crosses.
  EXPECT_EQ(kinds.print.distance.count, 26u * 26u - 4u);
  EXPECT_EQ(kinds.bright_print.distance.count, 26u * 26u - 4u - 20u * 20u);
  EXPECT_NEAR(kinds.blank.error_over_bound(), 2 * kinds.blank.error_over_claim(), 1e-6);
  EXPECT_EQ(kinds.near_gutter.distance.count, 0u);
}

TEST(CompareKinds, FindsWhatLiesNearTheGutter) {
  const KnownErrors known;
  const KindView view = known.view();
  std::vector<Eigen::Vector3f> gutter;
  for (float y = -200; y <= 200; y += 4) gutter.push_back({30, y, 0});
  const KindComparison kinds = compare_kinds({&view, 1}, gutter, {}, {});
  std::size_t expected = 0;
  for (const Eigen::Vector3f& point : known.truth.pixels()) expected += std::abs(point.x() - 30) < 15 ? 1 : 0;
  EXPECT_NEAR(static_cast<double>(kinds.near_gutter.distance.count), static_cast<double>(expected),
              0.15 * static_cast<double>(expected));  // those at rims have no normal
  EXPECT_TRUE(std::isnan(kinds.blank.bound_rms));
}

}  // namespace
}  // namespace pagesweep
