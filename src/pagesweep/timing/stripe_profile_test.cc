// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/stripe_profile.h"

#include <gtest/gtest.h>

#include "pagesweep/timing/stripe_pixel_testing.h"

namespace pagesweep {
namespace {

std::vector<StripeProfile::Point> points_of(const testing::Shape& shape, double begin, double end) {
  std::vector<StripeProfile::Point> points;
  for (double t = begin; t < end; t += 0.05) points.push_back({t, shape(t)});
  return points;
}

TEST(StripeProfile, FollowsAGaussianWhereverItLies) {
  const auto shape = [](double t) { return 7 * testing::gaussian(3)(t - 20); };
  const auto profile = StripeProfile::fit(points_of(shape, 5, 35), 5, 35, 0.5, 0);
  for (double t = -14; t < 14; t += 0.1) {
    EXPECT_NEAR(profile.value(t), testing::gaussian(3)(t), 2e-5);
    EXPECT_NEAR(profile.derivative(t), -t / 9 * testing::gaussian(3)(t), 1e-4);
  }
  EXPECT_NEAR(profile.full_width_half_maximum(), 2 * std::sqrt(2 * std::log(2.0)) * 3, 0.02);
  EXPECT_NEAR(profile.begin(), -15, 1e-3);
  EXPECT_EQ(profile.value(-16), 0);
  EXPECT_EQ(profile.derivative(16), 0);
}

TEST(StripeProfile, IsTwiceContinuouslyDifferentiable) {
  const auto profile = StripeProfile::fit(points_of(testing::skewed(2, 4), -10, 16), -10, 16, 1.0);
  constexpr double h = 1e-4;
  // Slope and curvature must not jump between two places h apart; the third derivative is below 1 a frame^3 here.
  for (double t = profile.begin() - 1; t < profile.end() + 1; t += h) {
    EXPECT_NEAR(profile.derivative(t + h), profile.derivative(t), h);
    EXPECT_NEAR(profile.derivative(t), (profile.value(t + h) - profile.value(t - h)) / (2 * h), 1e-4);
  }
}

TEST(StripeProfile, HasItsOriginAtItsCentreOfMass) {
  const auto profile = StripeProfile::fit(points_of(testing::skewed(2, 5), -10, 20), -10, 20, 0.4);
  double mass = 0, moment = 0, upper_mass = 0, upper_moment = 0;
  for (double t = -20; t < 20; t += 0.001) {
    const double value = profile.value(t), above = std::max(0.0, value - 0.2);
    mass += value, moment += value * t;
    upper_mass += above, upper_moment += above * t;
  }
  EXPECT_NEAR(moment / mass, 0, 1e-3);
  EXPECT_NEAR(profile.upper_centre(), upper_moment / upper_mass, 1e-3);
  EXPECT_LT(profile.upper_centre(), -0.05);  // its tail is behind
}

TEST(StripeProfile, BridgesAGapSmoothly) {
  auto points = points_of(testing::gaussian(4), -14, 14);
  std::erase_if(points, [](const auto& point) { return point.value > 0.6; });  // a clipped capture
  const auto profile = StripeProfile::fit(points, -14, 14, 0.5);
  // Its height is guessed from the flanks, and the flanks' times keep their distance whatever the guess.
  EXPECT_NEAR(profile.value(-6) / profile.value(-8), testing::gaussian(4)(6) / testing::gaussian(4)(8), 0.02);
  EXPECT_NEAR(profile.value(6), profile.value(-6), 0.01);
}

TEST(StripeProfile, RefusesWhatIsNoProfile) {
  const auto points = points_of(testing::gaussian(4), -14, 14);
  EXPECT_THROW(StripeProfile::fit(points, -1, 1, 0.5), std::invalid_argument);
  EXPECT_THROW(StripeProfile::fit({}, -14, 14, 0.5), std::invalid_argument);
  EXPECT_EQ(StripeProfile().value(0), 0);
}

}  // namespace
}  // namespace pagesweep
