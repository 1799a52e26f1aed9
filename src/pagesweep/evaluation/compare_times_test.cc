// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/evaluation/compare_times.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "pagesweep/sim/analytic_scene.h"

namespace pagesweep {
namespace {

struct Scene {
  Rig rig = sim::make_test_rig(128);
  std::vector<TimeMap> times;
  std::vector<TruePoints> truth;

  Scene() {
    const sim::AnalyticScene surface{.height = [](double x, double y) {
      return std::abs(x) < 100 && std::abs(y) < 80 ? 20 + 8 * std::sin(x / 40) : NAN;
    }};
    for (const Camera& camera : rig.cameras) {
      times.push_back(surface.times(camera, *rig.light, 0.02));
      const PointMap points = surface.points(camera);
      TruePoints& true_points = truth.emplace_back(camera.width, camera.height);
      for (int y = 0; y < camera.height; ++y)
        for (int x = 0; x < camera.width; ++x) true_points(x, y) = {points.x(x, y), points.y(x, y), points.z(x, y)};
    }
  }
  std::vector<TimedView> views() const { return {{&times[0], &truth[0]}, {&times[1], &truth[1]}}; }
};

TEST(CompareTimes, TheTruthIsRightUpToAConventionOfTheMiddle) {
  Scene scene;
  for (TimeMap& map : scene.times)
    for (float& time : map.time.pixels()) time += 0.3f;
  const TimeComparison comparison = compare_times(scene.views(), *scene.rig.light);
  EXPECT_NEAR(comparison.offset_frames, 0.3, 1e-5);
  EXPECT_LT(comparison.all.error.max, 5e-5) << "float's resolution at 200 frames is 1.5e-5";
}

TEST(CompareTimes, ADifferenceBetweenCamerasIsAnError) {
  Scene scene;
  for (float& time : scene.times[0].time.pixels()) time += 0.1f;
  const TimeComparison comparison = compare_times(scene.views(), *scene.rig.light);
  EXPECT_GT(comparison.all.error.max, 0.05 - 1e-3);
}

TEST(CompareTimes, TellsBrightFromDarkAndBlankFromEdges) {
  Scene scene;
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0, 1);
  for (TimeMap& map : scene.times)
    for (int y = 0; y < map.height(); ++y)
      for (int x = 0; x < map.width(); ++x) {
        const bool dark = x % 32 < 16;
        map.amplitude(x, y) = dark ? 30.f : 100.f;
        const double sigma = dark ? 0.06 : 0.02;
        map.time(x, y) += static_cast<float>(sigma * noise(random));
        map.sigma(x, y) = static_cast<float>(sigma);
      }
  const TimeComparison comparison = compare_times(scene.views(), *scene.rig.light);
  // Thousands of pixels of each kind: their rms is known to 2 %.
  EXPECT_NEAR(comparison.bright.error.rms, 0.02, 0.001);
  EXPECT_NEAR(comparison.dark.error.rms, 0.06, 0.003);
  EXPECT_NEAR(comparison.all.error_over_claim(), 1, 0.03);
  // Steps between columns 15|16 and 31|32: two of 16 columns see one.
  const auto edges = static_cast<double>(comparison.print_edges.error.count);
  const auto blank = static_cast<double>(comparison.blank.error.count);
  EXPECT_NEAR(edges / (edges + blank), 2.0 / 16, 0.02);
}

TEST(CompareTimes, NothingMeasuredGivesNothing) {
  Scene scene;
  for (TimeMap& map : scene.times) map = TimeMap(map.width(), map.height());
  const TimeComparison comparison = compare_times(scene.views(), *scene.rig.light);
  EXPECT_EQ(comparison.all.error.count, 0u);
  EXPECT_TRUE(std::isnan(comparison.offset_frames));
}

}  // namespace
}  // namespace pagesweep
