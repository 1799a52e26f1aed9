// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/advise_exposure.h"

#include <gmock/gmock.h>

#include "pagesweep/timing/estimate_times.h"
#include "pagesweep/timing/stripe_pixel_testing.h"

namespace pagesweep {
namespace {

using ::testing::HasSubstr;

constexpr int width = 48, height = 40;

ExposureAdvice advise(double paper, double sigma, int count = 120) {
  const auto shape = testing::gaussian(sigma);
  const auto light = [&](int x, int y, int i) {
    // Paper of which a tenth is printed, and no stripe on the left.
    const double amplitude = x < 8 ? 0 : (x + y) % 10 == 0 ? 0.1 * paper : paper;
    return testing::light(shape, {.amplitude = amplitude, .time = 40 + 0.8 * y}, i);
  };
  const std::vector<Frames> cameras{testing::make_frames(width, height, count, {}, light)};
  const Timing timing = estimate_times(cameras);
  return advise_exposure(cameras[0].sequence(), timing.maps[0], count_clipped(cameras[0]), timing.profile);
}

TEST(AdviseExposure, LeavesAGoodOneAlone) {
  const ExposureAdvice advice = advise(225, 3.4);
  EXPECT_TRUE(advice.is_good) << describe(advice);
  EXPECT_EQ(advice.light_factor, 1);
  EXPECT_EQ(advice.clipped_share, 0);
  EXPECT_NEAR(advice.stripe_frames, 3.4 * 2.355, 0.2);
}

TEST(AdviseExposure, AsksForMoreLightByWhatIsMissing) {
  const ExposureAdvice advice = advise(75, 3.4);
  EXPECT_FALSE(advice.is_good);
  EXPECT_NEAR(advice.light_factor, 0.92 * (255 - 4) / 75, 0.15);
  EXPECT_THAT(describe(advice, 2, 10), HasSubstr("times the exposure"));
  EXPECT_THAT(describe(advice, 5, 10), HasSubstr("too long"));
}

TEST(AdviseExposure, AsksForLessWherePaperIsClipped) {
  const ExposureAdvice advice = advise(350, 3.4);
  EXPECT_NEAR(advice.clipped_share, 0.9, 0.05);
  EXPECT_LT(advice.light_factor, 0.8);
  EXPECT_GT(advice.light_factor, 0.5);
}

TEST(AdviseExposure, KnowsAStripeThatIsTooFastOrTooSlow) {
  EXPECT_LT(advise(225, 1.3).speed_factor, 0.6);
  EXPECT_GT(advise(225, 9, 300).speed_factor, 2);
}

}  // namespace
}  // namespace pagesweep
