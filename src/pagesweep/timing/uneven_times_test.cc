// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <numeric>

#include "pagesweep/timing/estimate_times.h"
#include "pagesweep/timing/stripe_pixel_testing.h"
#include "pagesweep/timing/time_stream.h"

namespace pagesweep {
namespace {

constexpr int width = 64, height = 60, count = 140;
constexpr double sigma = 3.4;

testing::Pixel sheet(int x, int y) { return {.amplitude = 170, .time = 30 + 1.3 * y + 0.05 * x}; }

/// Frames that were exposed late or early by up to `most` frames, and say so if `are_told`.
Frames make_frames(double most, bool are_told, std::uint64_t seed = 1, const std::vector<int>& dropped = {}) {
  const auto late = [&](int i) { return most * (2 * testing::uniform(77, static_cast<std::uint64_t>(i)) - 1); };
  const auto shape = testing::gaussian(sigma);
  const auto light = [&](int x, int y, int i) { return testing::light(shape, sheet(x, y), i + late(i)); };
  const Frames even = testing::make_frames(width, height, count, {}, light, seed, dropped);
  Frames frames(even.sequence());
  for (int i = 0; i < count; ++i)
    if (even.has(i)) frames.set(i, even.frame(i), are_told ? static_cast<float>(late(i)) : 0);
  return frames;
}

struct Errors {
  double rms = 0, bias = 0;
  int count = 0;
};
Errors errors_of(const TimeMap& map) {
  Errors errors;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      if (map.status(x, y) != PixelStatus::ok) continue;
      const double error = map.time(x, y) - sheet(x, y).time;
      errors.rms += error * error, errors.bias += error, ++errors.count;
    }
  errors.rms = std::sqrt(errors.rms / errors.count);
  errors.bias /= errors.count;
  return errors;
}
/// One map's error less the common one: the profile's zero is anywhere.
Errors estimate(const Frames& frames, const TimingOptions& options = {}) {
  const std::vector<Frames> cameras{frames};
  Errors errors = errors_of(estimate_times(cameras, options).maps[0]);
  errors.rms = std::sqrt(errors.rms * errors.rms - errors.bias * errors.bias);
  return errors;
}

double bound() { return testing::cramer_rao_bound(testing::gaussian(sigma), sheet(30, 30), {}, count); }

class UnevenTimes : public ::testing::TestWithParam<double> {};

TEST_P(UnevenTimes, CostNothingIfTheyAreKnown) {
  const Errors errors = estimate(make_frames(GetParam(), true));
  EXPECT_GT(errors.count, 0.97 * width * height);
  EXPECT_LT(errors.rms, 1.06 * bound());  // learned from 3840 pixels, the profile is a little wrong itself
}

TEST_P(UnevenTimes, MatterIfTheyAreNot) { EXPECT_GT(estimate(make_frames(GetParam(), false)).rms, 1.3 * bound()); }

// 0.2 frames: vectors of pixels; 0.9: one by one.
INSTANTIATE_TEST_SUITE_P(LateBy, UnevenTimes, ::testing::Values(0.2, 0.5, 0.9));

TEST(UnevenTimes, LostFramesCostTheirLightAndNothingElse) {
  std::vector<int> dropped;
  for (int i = 0; i < count; ++i)
    if (testing::uniform(5, static_cast<std::uint64_t>(i)) < 0.1) dropped.push_back(i);
  const Errors errors = estimate(make_frames(0.2, true, 1, dropped));
  const double all = estimate(make_frames(0.2, true)).rms;
  // A tenth less light is 5 % more noise; which tenth it is matters as much again.
  EXPECT_LT(errors.rms, 1.15 * all);
}

TEST(UnevenTimes, TheProfileEstimatorIsNotBiasedByThem) {
  // Every frame was late by as much: to know it moves the times by that, however they are estimated.
  const TimingOptions options{.estimator = TimeEstimator::profile};
  const Frames even = make_frames(0, false);
  Frames late(even.sequence());
  for (int i = 0; i < count; ++i) late.set(i, even.frame(i), 0.25F);
  const std::vector<Frames> untold{even}, told{late};
  const TimeMap a = estimate_times(untold, options).maps[0], b = estimate_times(told, options).maps[0];
  int compared = 0;
  for (int y = 4; y < height; ++y) {
    if (a.status(30, y) != PixelStatus::ok || b.status(30, y) != PixelStatus::ok) continue;
    EXPECT_NEAR(b.time(30, y) - a.time(30, y), 0.25, 0.005) << y;
    ++compared;
  }
  EXPECT_GT(compared, height / 2);
}

TEST(UnevenTimes, FramesOneByOneGiveTheSameBitsAndNeedNoCountBeforehand) {
  const std::vector<Frames> cameras{make_frames(0.3, true, 1, {7, 8, 60}), make_frames(0.3, true, 2, {61})};
  std::vector<Sequence> sequences;
  for (const Frames& frames : cameras) {
    sequences.push_back(frames.sequence());
    sequences.back().count = 100'000;
  }
  TimeStream stream(sequences);
  for (int i = 0; i < count; ++i) {
    FrameSet set{i, {}, {cameras[0].late(i), cameras[1].late(i)}};
    for (const Frames& frames : cameras)
      set.images.push_back(frames.has(i) ? std::optional(frames.frame(i)) : std::nullopt);
    stream.add(std::move(set));
  }
  const Timing streamed = stream.finish(no_progress(), count);
  const Timing at_once = estimate_times(cameras);
  for (std::size_t c = 0; c < 2; ++c) {
    const Image<float>&a = streamed.maps[c].time, &b = at_once.maps[c].time;
    EXPECT_EQ(std::memcmp(a.data(), b.data(), a.size() * sizeof(float)), 0) << c;
  }
}

}  // namespace
}  // namespace pagesweep
