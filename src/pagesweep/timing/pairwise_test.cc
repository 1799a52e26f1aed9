// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/pairwise.h"

#include <gtest/gtest.h>

#include "pagesweep/timing/stripe_pixel_testing.h"

namespace pagesweep {
namespace {

using testing::Pixel;
using testing::Sensor;

/// The examples of the paper's Fig. 4, with an 8-bit camera and the interval of 30 gray values used there. The expected
/// scatter of a shift is sqrt(2) times the bound of one bell; 5 of it leave room for what eq. 8 loses to the bound.
class PaperFigure4 : public ::testing::Test {
 protected:
  double tolerance(const Pixel& pixel) const {
    return 5 * std::sqrt(2.0) * testing::cramer_rao_bound(shape, pixel, sensor, 60);
  }
  const testing::Shape shape = testing::gaussian(4);
  const Sensor sensor;
};

TEST_F(PaperFigure4, TwoPixelsOfDifferentPoints) {
  const Pixel first{.amplitude = 190, .background = 4, .time = 39.82},
      second{.amplitude = 120, .time = 39.82 - 17.3567};
  const auto shift =
      match_gray_values(testing::expose(shape, first, sensor, 60, 1), testing::expose(shape, second, sensor, 60, 2));
  ASSERT_TRUE(shift);
  EXPECT_NEAR(shift->c, -17.3567, tolerance(second));
  EXPECT_NEAR(shift->a, 120.0 / 190, 0.03);
}

TEST_F(PaperFigure4, TwoCorrespondingPixels) {
  const Pixel first{.amplitude = 190, .time = 28.4}, second{.amplitude = 160, .background = 6, .time = 28.4};
  const auto shift =
      match_gray_values(testing::expose(shape, first, sensor, 60, 3), testing::expose(shape, second, sensor, 60, 4));
  ASSERT_TRUE(shift);
  EXPECT_NEAR(shift->c, 0, tolerance(second));
  EXPECT_LT(std::abs(shift->c), 4 * shift->sigma);
}

TEST_F(PaperFigure4, AnOverexposedPixelAgainstATemplate) {
  std::vector<float> f;
  for (int k = 0; k < 31; ++k) f.push_back(static_cast<float>(200 * shape(k - 15.0)));
  const Pixel overexposed{.amplitude = 480, .time = 33.71};
  auto g = testing::expose(shape, overexposed, sensor, 60, 5);
  EXPECT_GT(std::ranges::count(g, std::numeric_limits<float>::infinity()), 5);
  const auto shift = match_gray_values(f, g);
  ASSERT_TRUE(shift);
  // The bell is sharply curved on its flanks, where linear interpolation (eq. 4) is off by up to 1/8 of the second
  // difference: 2 % of the slope's height there.
  EXPECT_NEAR(shift->c, 33.71 - 15, 0.05);
  EXPECT_NEAR(shift->a, 480.0 / 200, 0.1);
  // Taken for measurements, the clipped samples spoil height and shape.
  for (float& gray : g) gray = std::min(gray, 251.0F);
  const auto naive = match_gray_values(f, g);
  ASSERT_TRUE(naive);
  EXPECT_GT(naive->residual_rms, 5 * shift->residual_rms);
}

TEST(MatchGrayValues, HasNoAnswerWithoutABell) {
  const std::vector<float> dropped(60, std::numeric_limits<float>::quiet_NaN()), flat(60, 3.0F);
  EXPECT_FALSE(match_gray_values(dropped, flat));
  EXPECT_FALSE(match_gray_values(flat, flat));
}

/// Two cameras that see the same even sheet; the second one's picture is shifted by 6.3 px along the sweep.
TEST(ShiftPairwise, MovesAMatchThatIsOffBackToItsPlace) {
  constexpr int width = 24, height = 40;
  const double rate = 0.4;  // frames a pixel
  const auto shape = testing::gaussian(4);
  const Sensor sensor;
  const Frames from = testing::make_frames(
      width, height, 70, shape, sensor, [&](int, int y) { return Pixel{.amplitude = 180, .time = 25 + rate * y}; }, 1);
  const Frames to = testing::make_frames(
      width, height, 70, shape, sensor,
      [&](int, int y) { return Pixel{.amplitude = 150, .time = 25 + rate * (y - 6.3)}; }, 2);
  TimeMap to_times(width, height);
  Correspondences matches(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      to_times.time(x, y) = static_cast<float>(25 + rate * (y - 6.3));
      to_times.status(x, y) = PixelStatus::ok;
      if (y >= height - 10) continue;
      matches.u(x, y) = static_cast<float>(x);
      matches.v(x, y) = static_cast<float>(y + 6.3 + 0.4);  // 0.16 frames off
      matches.status(x, y) = PixelStatus::ok;
    }
  const Correspondences shifted = shift_pairwise(matches, from, to, to_times, {});
  double sum = 0, squares = 0, claimed = 0;
  int count = 0;
  for (int y = 0; y < height - 10; ++y)
    for (int x = 0; x < width; ++x) {
      ASSERT_EQ(shifted.status(x, y), PixelStatus::ok);
      EXPECT_NEAR(shifted.u(x, y), x, 0.01);  // times change along y only
      const double error = shifted.v(x, y) - (y + 6.3);
      sum += error, squares += error * error, claimed += shifted.sigma(x, y) * shifted.sigma(x, y), ++count;
    }
  EXPECT_EQ(shifted.status(0, height - 1), PixelStatus::not_computed);
  const double bound = testing::cramer_rao_bound(shape, {.amplitude = 150, .time = 30.5}, sensor, 70) / rate;
  EXPECT_NEAR(sum / count, 0, bound);                  // eq. 8's own phase bias stays below its noise
  EXPECT_LT(std::sqrt(squares / count), 2.5 * bound);  // two noisy bells and that bias
  EXPECT_NEAR(std::sqrt(claimed / count), std::sqrt(squares / count), 0.6 * std::sqrt(squares / count));
}

}  // namespace
}  // namespace pagesweep
