// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/footprint/weigh_footprints.h"

#include <gtest/gtest.h>

#include <cmath>

#include "pagesweep/data/linear_light.h"
#include "pagesweep/sim/analytic_scene.h"

namespace pagesweep {
namespace {

const Rig& rig() {
  static const Rig made = sim::make_test_rig(96);
  return made;
}

/// A scan with black to the left of column `edge`, white from there on.
Picture half_black(double edge) {
  Picture scan = make_picture(rig().scanner->width(), rig().scanner->height(), 1, 8);
  auto& samples = std::get<Image<std::uint8_t>>(scan.samples);
  for (int y = 0; y < samples.height(); ++y)
    for (int x = static_cast<int>(edge); x < samples.width(); ++x) samples(x, y) = 255;
  return scan;
}

TEST(WeighFootprints, AtASharpEdgeTheMiddleIsThatOfAHalfGaussian) {
  const sim::AnalyticScene sheet{[](double, double) { return 10.0; }};
  const PointMap points = sheet.points(rig().cameras[0]);
  const double edge = 0.5 * rig().scanner->width(), variance = 0.4;
  const SpotOffsets offsets = weigh_footprints(points, *rig().scanner, linear_light(half_black(edge)), variance);
  // E[x | x > c] of a Gaussian is its density at c over what lies beyond.
  const double sigma = std::sqrt(variance);
  int near = 0;
  for (int y = 20; y < 76; ++y)
    for (int x = 2; x < 94; ++x) {
      if (!std::isfinite(offsets.dx(x, y))) continue;
      const auto at = [&](int column) {
        return rig().scanner->project({points.x(column, y), points.y(column, y), points.z(column, y)})->x();
      };
      const double scan_px_per_px = 0.5 * (at(x + 1) - at(x - 1));
      const double c = (edge - 0.5 - at(x)) / scan_px_per_px / sigma;  // of the edge, in standard deviations
      if (std::abs(c) > 1.5) continue;
      const double expected =
          sigma * std::exp(-0.5 * c * c) / std::sqrt(2 * M_PI) / (0.5 * std::erfc(c / std::sqrt(2)));
      // Half a standard deviation between the places, and the disc's end, leave a tenth of it.
      EXPECT_NEAR(offsets.dx(x, y), expected, 0.1 * sigma);
      ++near;
    }
  EXPECT_GT(near, 50);
}

TEST(WeighFootprints, BlankPaperIsSeenWhereThePixelLooks) {
  const sim::AnalyticScene sheet{[](double x, double) { return 20 + 10 * std::cos(x / 40); }};
  const PointMap points = sheet.points(rig().cameras[0]);
  const SpotOffsets offsets = weigh_footprints(points, *rig().scanner, linear_light(half_black(0)), 0.4);
  int count = 0;
  for (const float dx : offsets.dx.pixels())
    if (std::isfinite(dx)) {
      EXPECT_NEAR(dx, 0, 1e-4);
      ++count;
    }
  EXPECT_GT(count, 1000);
}

TEST(WeighFootprints, KnowsNothingWhereNoPointIs) {
  PointMap points(96, 96);
  const SpotOffsets offsets = weigh_footprints(points, *rig().scanner, linear_light(half_black(100)), 0.4);
  for (const float dx : offsets.dx.pixels()) EXPECT_TRUE(std::isnan(dx));
  EXPECT_THROW(weigh_footprints(points, *rig().scanner, Image<float>(10, 10), 0.4), std::invalid_argument);
  EXPECT_THROW(weigh_footprints(points, *rig().scanner, linear_light(half_black(100)), 0), std::invalid_argument);
}

}  // namespace
}  // namespace pagesweep
