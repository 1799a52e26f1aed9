// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/evaluation/time_bound.h"

#include <gtest/gtest.h>

#include <cmath>

namespace pagesweep {
namespace {

TruthProfile gaussian(double sigma_frames) {
  TruthProfile profile{-6 * sigma_frames, 0.05, {}};
  for (double t = profile.start_frames; t <= 6 * sigma_frames; t += profile.step_frames)
    profile.values.push_back(std::exp(-0.5 * t * t / (sigma_frames * sigma_frames)));
  return profile;
}

TEST(TimeBound, OfAGaussianInWhiteNoiseIsTheTextbooks) {
  // Without shot noise: var(t) = noise^2 / (A^2 sum p'^2), sum p'^2 = sqrt(pi) / (2 sigma); p' is odd and p even, so
  // unknown amplitude and background cost nothing.
  const double sigma = 4, read_noise = 1, amplitude = 100;
  const TimeBound bound(gaussian(sigma), {1e12, read_noise}, 1e9);
  const double noise = std::sqrt(read_noise * read_noise + 1.0 / 12);
  EXPECT_NEAR(bound(amplitude), noise / amplitude * std::sqrt(2 * sigma / std::sqrt(M_PI)), 2e-5);
  EXPECT_NEAR(bound(amplitude) / bound(10 * amplitude), 10, 0.05);
}

TEST(TimeBound, ShotNoiseAndClippingCost) {
  const TimeBound quiet(gaussian(4), {1e12, 1}, 1e9), noisy(gaussian(4), {40, 1}, 1e9),
      clipped(gaussian(4), {40, 1}, 150);
  EXPECT_GT(noisy(200), 1.2 * quiet(200));
  EXPECT_GT(clipped(200), noisy(200));
  EXPECT_NEAR(clipped(100), noisy(100), 1e-9) << "nothing is clipped";
}

TEST(TimeBound, FramesCountByTheSquareOfTheirExposure) {
  // White noise: a frame of half the exposure has a quarter of the information.
  const TimeBound alike(gaussian(4), {1e12, 1}, 1e9), mixed(gaussian(4), {1e12, 1}, 1e9, {1, 0.5});
  EXPECT_NEAR(mixed(100) / alike(100), std::sqrt(2 / 1.25), 1e-3);
  // Only the long exposure is clipped, where light exceeds half of the amplitude.
  const TimeBound whole(gaussian(4), {40, 1}, 1e9, {1, 0.5}), clipped(gaussian(4), {40, 1}, 50, {1, 0.5});
  EXPECT_GT(clipped(99), 1.05 * whole(99));
  EXPECT_LT(clipped(99), 2 * whole(99)) << "the short exposure still sees the tip";
  EXPECT_NEAR(clipped(49), whole(49), 1e-9) << "nothing is clipped";
}

TEST(TimeBound, RefusesWhatSaysNothing) {
  EXPECT_THROW(TimeBound({0, 1, {1, 1}}, {40, 1}, 250), std::invalid_argument);
  EXPECT_THROW(TimeBound(gaussian(4), {0, 1}, 250), std::invalid_argument);
  const TimeBound bound(gaussian(4), {40, 1}, 250);
  EXPECT_TRUE(std::isnan(bound(-1)));
  EXPECT_TRUE(std::isnan(bound(NAN)));
}

}  // namespace
}  // namespace pagesweep
