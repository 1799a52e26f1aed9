// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/time_stream.h"

#include <gtest/gtest.h>

#include <cstring>

#include "pagesweep/base/error.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/timing/stripe_pixel_testing.h"

namespace pagesweep {
namespace {

using testing::Pixel;

constexpr int width = 150, height = 110, count = 230;

/// A sheet over which the stripe moves down, with print, a step in depth, a dark corner and, on the left, a second,
/// brighter pass later on: what was estimated there at first does not hold.
Pixel sheet(int x, int y) {
  Pixel pixel{.amplitude = (x / 5 + y / 7) % 3 == 0 ? 40.0 : 170.0, .time = 22 + 1.6 * y + 0.05 * x};
  if (x > 100) pixel.time += 12;
  if (x > 120 && y > 90) pixel.amplitude = 0;
  pixel.width = 1 + 0.0006 * y;
  return pixel;
}

std::vector<Frames> make_cameras(const testing::Sensor& sensor = {}, const std::vector<int>& dropped = {}) {
  const auto shape = testing::gaussian(3.4);
  std::vector<Frames> cameras;
  for (const std::uint64_t seed : {1, 2}) {
    const auto light = [&](int x, int y, int i) {
      const double again =
          x < 20 && y > 30 && y < 60 ? 1.3 * testing::light(shape, {.background = 0, .time = 200}, i) : 0;
      return testing::light(shape, sheet(x, y), i) + again;
    };
    cameras.push_back(testing::make_frames(width, height, count, sensor, light, seed, dropped));
  }
  return cameras;
}

/// What a stream makes of the frames when they come in one by one.
struct Streamed {
  Timing timing;
  int most_kept = 0;
  std::vector<Image<std::uint8_t>> clipped;
};
Streamed stream(const std::vector<Frames>& cameras, const TimingOptions& options = {}) {
  std::vector<Sequence> sequences;
  for (const Frames& frames : cameras) sequences.push_back(frames.sequence());
  TimeStream times(sequences, options);
  Streamed result;
  for (int i = 0; i < cameras[0].count(); ++i) {
    FrameSet set{i, {}};
    for (const Frames& frames : cameras)
      set.images.push_back(frames.has(i) ? std::optional(frames.frame(i)) : std::nullopt);
    times.add(std::move(set));
    result.most_kept = std::max(result.most_kept, times.frames_kept());
  }
  result.timing = times.finish();
  for (std::size_t c = 0; c < cameras.size(); ++c) result.clipped.push_back(times.clipped_frames(c));
  return result;
}

template <class T>
bool are_equal(const Image<T>& a, const Image<T>& b) {
  return a.width() == b.width() && a.height() == b.height() &&
         std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
}

void expect_same(const Timing& a, const Timing& b) {
  ASSERT_EQ(a.maps.size(), b.maps.size());
  for (std::size_t c = 0; c < a.maps.size(); ++c) {
    EXPECT_TRUE(are_equal(a.maps[c].time, b.maps[c].time)) << c;
    EXPECT_TRUE(are_equal(a.maps[c].sigma, b.maps[c].sigma)) << c;
    EXPECT_TRUE(are_equal(a.maps[c].amplitude, b.maps[c].amplitude)) << c;
    EXPECT_TRUE(are_equal(a.maps[c].residual, b.maps[c].residual)) << c;
    EXPECT_TRUE(are_equal(a.maps[c].status, b.maps[c].status)) << c;
    EXPECT_EQ(a.widths[c].range(), b.widths[c].range()) << c;
    EXPECT_EQ(a.noise[c].gain, b.noise[c].gain) << c;
  }
}

double share_ok(const TimeMap& map) {
  return static_cast<double>(std::ranges::count(map.status.pixels(), PixelStatus::ok)) /
         static_cast<double>(map.status.size());
}

TEST(TimeStream, FramesOneByOneGiveTheSameBitsAsAllAtOnce) {
  const std::vector<Frames> cameras = make_cameras();
  const Streamed streamed = stream(cameras);
  expect_same(streamed.timing, estimate_times(cameras));
  EXPECT_GT(share_ok(streamed.timing.maps[0]), 0.9);
}

TEST(TimeStream, TheBrighterPassCounts) {
  const Streamed streamed = stream(make_cameras());
  for (int y = 40; y < 50; ++y) EXPECT_NEAR(streamed.timing.maps[0].time(10, y), 200, 0.5);
}

TEST(TimeStream, DroppedFramesMakeNoDifference) {
  std::vector<int> dropped{0, 1, 33, 34, 35, 100, 229};
  for (int i = 140; i < 160; ++i) dropped.push_back(i);
  const std::vector<Frames> cameras = make_cameras({}, dropped);
  const Streamed streamed = stream(cameras);
  expect_same(streamed.timing, estimate_times(cameras));
}

TEST(TimeStream, NeitherDoesOverexposure) {
  const testing::Sensor sensor{.saturation = 150};
  const std::vector<Frames> cameras = make_cameras(sensor);
  const Streamed streamed = stream(cameras);
  expect_same(streamed.timing, estimate_times(cameras));
  EXPECT_TRUE(are_equal(streamed.clipped[1], count_clipped(cameras[1])));
}

TEST(TimeStream, NeitherDoDepthThreadsAndOptions) {
  const std::vector<Frames> cameras = make_cameras({.bit_depth = 12});
  const Streamed streamed = stream(cameras, {.uniform_width = true});
  const ThreadLimit one(1);
  expect_same(streamed.timing, estimate_times(cameras, {.uniform_width = true}));
}

TEST(TimeStream, KeepsOnlyTheFramesThatWindowsNeed) {
  const std::vector<Frames> cameras = make_cameras();
  const Streamed streamed = stream(cameras);
  // A window is some seven widths of the stripe long (8 frames), a step 16 frames.
  EXPECT_LT(streamed.most_kept, 2 * (7 * 8 + 2 * 16 + 10));
}

TEST(TimeStream, SeveralExposuresNeedAllFrames) {
  const std::vector<Frames> cameras = make_cameras({.saturation = 150, .exposures = {1, 0.4}});
  const Streamed streamed = stream(cameras);
  EXPECT_EQ(streamed.most_kept, 2 * count);
  expect_same(streamed.timing, estimate_times(cameras));
  EXPECT_TRUE(are_equal(streamed.clipped[0], count_clipped(cameras[0])));
}

TEST(TimeStream, FramesThatNeverComeCountAsDropped) {
  std::vector<Frames> cameras = make_cameras();
  for (Frames& frames : cameras)
    for (int i = 120; i < count; ++i) frames.forget(i);
  const Streamed streamed = stream(cameras);
  expect_same(streamed.timing, estimate_times(cameras));
  EXPECT_EQ(streamed.timing.maps[0].status(50, 40), PixelStatus::ok);
  EXPECT_NE(streamed.timing.maps[0].status(50, 100), PixelStatus::ok);
}

TEST(TimeStream, SaysThatNoStripePassed) {
  std::vector<Frames> cameras;
  cameras.push_back(testing::make_frames(40, 30, 60, {}, [](int, int, int) { return 3.0; }));
  EXPECT_THROW(stream(cameras), Error);
}

}  // namespace
}  // namespace pagesweep
