// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/edge_correction.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace pagesweep {
namespace {

constexpr double spot_sigma = 0.6, spot_variance = spot_sigma * spot_sigma;  // [px], [px^2]
constexpr double sigma_frames = 0.01, across = 0.2, down = 0.3;              // [frames], [frames/px]

double true_time(double x, double y) { return 50 + across * x + down * y; }

/// Print: slanted strokes, 0.1 to 0.8 of the light, with edges much sharper than the spot.
double albedo(double x, double y) { return std::sin(0.8 * x + 0.35 * y) > 0.3 ? 0.1 : 0.8; }

/// What a camera with a Gaussian spot sees of it: amplitude and time, both by numerical integration over the spot.
TimeMap printed_page(bool step = false) {
  TimeMap map(64, 64);
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0, sigma_frames);
  for (int y = 0; y < 64; ++y)
    for (int x = 0; x < 64; ++x) {
      double mass = 0, moment = 0;
      for (double j = -2; j <= 2; j += 0.1)
        for (double i = -2; i <= 2; i += 0.1) {
          const double light = albedo(x + i, y + j) * std::exp(-(i * i + j * j) / (2 * spot_variance));
          mass += light;
          moment += light * true_time(x + i, y + j);
        }
      map.time(x, y) = static_cast<float>(moment / mass + noise(random) + (step && x >= 32 ? 6 : 0));
      map.amplitude(x, y) = static_cast<float>(200 * mass * 0.01 / (2 * M_PI * spot_variance));
      map.sigma(x, y) = sigma_frames;
      map.status(x, y) = PixelStatus::ok;
    }
  return map;
}

/// Rms of what is wrong with the times, over their sigma.
double error_over_sigma(const TimeMap& map) {
  double squares = 0, count = 0;
  for (int y = 3; y < 61; ++y)
    for (int x = 3; x < 61; ++x, ++count) squares += std::pow((map.time(x, y) - true_time(x, y)) / map.sigma(x, y), 2);
  return std::sqrt(squares / count);
}

TEST(EdgeCorrection, TweediesFormulaTakesMostOfTheErrorAndOwnsUpToTheRest) {
  TimeMap map = printed_page();
  const double before = error_over_sigma(map);
  const SpotOffsets offsets = offsets_from_amplitude(map);
  const auto comparisons = compare_with_surroundings(map, offsets);
  const EdgeCorrection correction = fit_edges(map, comparisons);
  correct_edges(map, comparisons, correction);
  EXPECT_GT(before, 2.5);
  // The spot's variance, as far as pixels a whole spot apart can tell a gradient.
  EXPECT_NEAR(correction.gain, spot_variance, 0.25 * spot_variance);
  EXPECT_LT(correction.after, 0.6 * correction.before);
  EXPECT_NEAR(error_over_sigma(map), 1, 0.15);
}

TEST(EdgeCorrection, TrueOffsetsLeaveTheNoiseAlone) {
  TimeMap map = printed_page();
  SpotOffsets offsets(64, 64);
  for (int y = 0; y < 64; ++y)
    for (int x = 0; x < 64; ++x) {
      double mass = 0, mx = 0, my = 0;
      for (double j = -2; j <= 2; j += 0.1)
        for (double i = -2; i <= 2; i += 0.1) {
          const double light = albedo(x + i, y + j) * std::exp(-(i * i + j * j) / (2 * spot_variance));
          mass += light;
          mx += light * i;
          my += light * j;
        }
      offsets.dx(x, y) = static_cast<float>(mx / mass);
      offsets.dy(x, y) = static_cast<float>(my / mass);
    }
  const auto comparisons = compare_with_surroundings(map, offsets);
  const EdgeCorrection correction = fit_edges(map, comparisons);
  EXPECT_NEAR(correction.gain, 1, 0.1);  // errors at edges pull the planes along that they are compared with
  correct_edges(map, comparisons, correction);
  EXPECT_NEAR(error_over_sigma(map), 1, 0.08);
}

TEST(EdgeCorrection, OffsetsThatExplainNothingChangeNothing) {
  TimeMap map = printed_page();
  const TimeMap before = map;
  SpotOffsets offsets(64, 64);
  std::mt19937 random(9);
  std::normal_distribution<float> normal(0, 0.3f);
  for (std::size_t i = 0; i < offsets.dx.size(); ++i) {
    offsets.dx.data()[i] = normal(random);
    offsets.dy.data()[i] = normal(random);
  }
  const auto comparisons = compare_with_surroundings(map, offsets);
  const EdgeCorrection correction = fit_edges(map, comparisons);
  EXPECT_EQ(correction.gain, 0);
  correct_edges(map, comparisons, correction);
  for (std::size_t i = 0; i < map.time.size(); ++i) EXPECT_EQ(map.time.data()[i], before.time.data()[i]);
}

TEST(EdgeCorrection, AtAStepInDepthOnlySigmaGrows) {
  TimeMap map = printed_page(true);
  const TimeMap before = map;
  const auto comparisons = compare_by_amplitude(map);
  correct_edges(map, comparisons, fit_edges(map, comparisons));
  for (int y = 4; y < 60; ++y) {
    EXPECT_EQ(map.time(31, y), before.time(31, y));
    EXPECT_GE(map.sigma(31, y), before.sigma(31, y));
  }
}

TEST(EdgeCorrection, RefusesOtherSizes) {
  EXPECT_THROW(compare_with_surroundings(TimeMap(4, 4), SpotOffsets(5, 4)), std::invalid_argument);
}

}  // namespace
}  // namespace pagesweep
