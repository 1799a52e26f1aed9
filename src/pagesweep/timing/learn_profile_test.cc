// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/learn_profile.h"

#include <gtest/gtest.h>

#include "pagesweep/base/error.h"
#include "pagesweep/timing/stripe_pixel_testing.h"

namespace pagesweep {
namespace {

using testing::Pixel;
using testing::Sensor;
using testing::Shape;

/// Bright paper with darker print, the stripe sweeping over it at any sub-frame phase.
Pixel page_pixel(int x, int y) {
  const auto place = static_cast<std::uint64_t>(y * 1000 + x);
  const double albedo = testing::uniform(7, place) < 0.2 ? 0.2 : 0.9 + 0.1 * testing::uniform(8, place);
  return {.amplitude = 190 * albedo, .background = 3, .time = 45 + 0.37 * y + 0.05 * x};
}

/// Largest difference between the learned profile and the formula brought to the same origin, which is found by the
/// best agreement, and its time.
struct Agreement {
  double largest = 1e9;
  double origin = 0;
};
Agreement compare(const StripeProfile& profile, const Shape& shape, double peak_height = 1) {
  Agreement best;
  for (double origin = -6; origin <= 6; origin += 0.002) {
    double largest = 0;
    for (double t = -30; t < 30 && largest < best.largest; t += 0.25)
      largest = std::max(largest, std::abs(profile.value(t) - shape(t + origin) / peak_height));
    if (largest < best.largest) best = {largest, origin};
  }
  return best;
}

double highest(const Shape& shape) {
  double height = 0;
  for (double t = -30; t < 30; t += 0.01) height = std::max(height, shape(t));
  return height;
}

class LearnStripe : public ::testing::TestWithParam<std::pair<const char*, Shape>> {};

TEST_P(LearnStripe, FindsTheShapeAndTheNoiseWithoutKnowingEither) {
  const Shape shape = GetParam().second;
  const Sensor sensor{.gain = 0.02, .read_noise = 1.2};
  const std::vector<Frames> cameras{testing::make_frames(40, 60, 130, shape, sensor, page_pixel)};
  const LearnedStripe learned = learn_stripe(cameras);
  // Some 1500 pixels with a noise of 1.2 % of the height, ten of their samples a knot.
  EXPECT_LT(compare(learned.profile, shape, highest(shape)).largest, 0.005);
  // Variance of a variance from some 30000 samples: 1 %; read noise and gain share it unevenly.
  EXPECT_NEAR(learned.noise[0].read_variance, sensor.variance(0), 0.08 * sensor.variance(0));
  EXPECT_NEAR(learned.noise[0].gain, sensor.gain, 0.15 * sensor.gain);
}

INSTANTIATE_TEST_SUITE_P(Shapes, LearnStripe,
                         ::testing::Values(std::pair{"narrow", testing::gaussian(1.5)},
                                           std::pair{"gaussian", testing::gaussian(4)},
                                           std::pair{"wide", testing::gaussian(8)},
                                           std::pair{"flat", testing::flat_topped(10, 1.2)},
                                           std::pair{"skewed", testing::skewed(2.5, 5)}),
                         [](const auto& test) { return test.param.first; });

}  // namespace
}  // namespace pagesweep
