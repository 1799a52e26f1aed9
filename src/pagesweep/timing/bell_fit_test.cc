// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/bell_fit.h"

#include <gtest/gtest.h>

#include <limits>

#include "pagesweep/timing/stripe_pixel_testing.h"

namespace pagesweep {
namespace {

StripeProfile profile_of(const testing::Shape& shape, double begin, double end) {
  std::vector<StripeProfile::Point> points;
  for (double t = begin; t < end; t += 0.05) points.push_back({t, shape(t)});
  return StripeProfile::fit(points, begin, end, 0.4, 0);
}

/// Samples without noise, as a profile has them.
std::vector<float> sample(const StripeProfile& profile, const Bell& bell, int count) {
  std::vector<float> gray;
  for (int i = 0; i < count; ++i) gray.push_back(static_cast<float>(bell.gray_at(i, profile)));
  return gray;
}

const StripeProfile skewed_profile = profile_of(testing::skewed(2.5, 4), -11, 17);

TEST(BellGradient, AgreesWithDifferences) {
  const Bell bell{.amplitude = 130, .background = 7, .time = 20.3, .width = 1.1};
  const auto changed = [&](int unknown, double step) {
    Bell other = bell;
    if (unknown == 0) other.amplitude += step;
    if (unknown == 1) other.background += step;
    if (unknown == 2) other.time += step;
    if (unknown == 3) other.width *= std::exp(step);
    return other;
  };
  constexpr double h = 1e-5;
  for (int frame = 8; frame < 40; ++frame) {
    const Eigen::Vector4d gradient = bell_gradient(bell, skewed_profile, frame);
    for (int i = 0; i < 4; ++i) {
      const double difference =
          (changed(i, h).gray_at(frame, skewed_profile) - changed(i, -h).gray_at(frame, skewed_profile)) / (2 * h);
      EXPECT_NEAR(gradient(i), difference, 1e-5) << "unknown " << i << " at frame " << frame;
    }
  }
}

TEST(FitBell, FindsWhatMadeTheSamples) {
  const Bell truth{.amplitude = 130, .background = 7, .time = 24.37};
  const auto gray = sample(skewed_profile, truth, 60);
  for (const double off : {-3.0, 0.0, 3.0}) {
    const Bell start{.amplitude = 100, .background = 0, .time = truth.time + off};
    const BellFit fit = fit_bell(gray, 0, skewed_profile, SensorNoise{}, start);
    EXPECT_TRUE(fit.converged);
    EXPECT_NEAR(fit.bell.time, truth.time, 1e-5);
    EXPECT_NEAR(fit.bell.amplitude, truth.amplitude, 1e-3);
    EXPECT_NEAR(fit.bell.background, truth.background, 1e-4);
    EXPECT_EQ(fit.samples, 60);
  }
}

TEST(FitBell, FindsTheWidthAndACurvedBackground) {
  Bell truth{.amplitude = 130, .background = 7, .time = 24.37, .width = 1.12};
  const Bell start{.amplitude = 100, .time = 24};
  const BellFit wide = fit_bell(sample(skewed_profile, truth, 60), 0, skewed_profile, SensorNoise{}, start,
                                {.unknowns = BellUnknowns::width, .log_width_sigma = 100});
  EXPECT_TRUE(wide.converged);
  EXPECT_NEAR(wide.bell.width, truth.width, 1e-5);
  EXPECT_NEAR(wide.bell.time, truth.time, 1e-5);
  truth = {.amplitude = 130, .background = 17, .time = 24.37, .width = 1, .slope = 0.5, .curvature = -0.01};
  const BellFit curved = fit_bell(sample(skewed_profile, truth, 60), 0, skewed_profile, SensorNoise{}, start,
                                  {.unknowns = BellUnknowns::curved_background});
  EXPECT_TRUE(curved.converged);
  EXPECT_NEAR(curved.bell.time, truth.time, 1e-4);
  EXPECT_NEAR(curved.bell.slope, truth.slope, 1e-4);
  EXPECT_NEAR(curved.bell.curvature, truth.curvature, 1e-5);
}

TEST(FitBell, ClaimsTheCramerRaoBound) {
  const testing::Shape shape = testing::skewed(2.5, 4);
  const testing::Pixel pixel{.amplitude = 130, .background = 7, .time = 40.3};
  const testing::Sensor sensor;
  const SensorNoise noise{.read_variance = sensor.variance(0), .gain = sensor.gain};
  const double origin = fit_bell(testing::expose(shape, pixel, {.gain = 0, .read_noise = 0}, 90, 1), 0, skewed_profile,
                                 noise, {.amplitude = 100, .time = 40})
                            .bell.time;
  const auto gray = sample(skewed_profile, {.amplitude = 130, .background = 7, .time = origin}, 90);
  const BellFit fit = fit_bell(gray, 0, skewed_profile, noise, {.amplitude = 100, .time = 40});
  const double bound = testing::cramer_rao_bound(shape, pixel, sensor, 90);
  EXPECT_NEAR(fit.time_sigma(), bound, 0.01 * bound);
}

TEST(FitBell, CensoredSamplesPullOnlyWhereTheModelIsBelowTheCeiling) {
  const Bell truth{.amplitude = 400, .background = 7, .time = 24.37};
  auto gray = sample(skewed_profile, truth, 60);
  const SensorNoise noise{.read_variance = 1, .gain = 0.02, .ceiling = 250};
  int clipped = 0;
  for (float& value : gray)
    if (value >= noise.ceiling) value = std::numeric_limits<float>::infinity(), ++clipped;
  ASSERT_GT(clipped, 4);
  const BellFit fit = fit_bell(gray, 0, skewed_profile, noise, {.amplitude = 300, .time = 25});
  EXPECT_TRUE(fit.converged);
  EXPECT_EQ(fit.samples, 60 - clipped);
  // The two samples beside the plateau are censored without noise: a hundredth of a frame is their half standard
  // deviation.
  EXPECT_NEAR(fit.bell.time, truth.time, 0.01);
  EXPECT_NEAR(fit.bell.amplitude, truth.amplitude, 4);
}

}  // namespace
}  // namespace pagesweep
