// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "pagesweep/base/error.h"
#include "pagesweep/io/frame_instants_internal.h"

namespace pagesweep {
namespace {

Capture two_cameras(std::vector<std::int64_t> first, std::vector<std::int64_t> second) {
  Capture capture;
  const int count = static_cast<int>(first.size());
  capture.sequences.push_back(
      {.camera = "cam1", .frames = "%d.png", .count = count, .timestamps_ns = std::move(first)});
  capture.sequences.push_back(
      {.camera = "cam2", .frames = "%d.png", .count = count, .timestamps_ns = std::move(second)});
  return capture;
}

TEST(FrameInstants, AreTheFramesWhereThereAreNoTimes) {
  Capture capture;
  capture.sequences.push_back({.camera = "cam1", .frames = "%d.png", .count = 3});
  const auto instants = instants_of(capture);
  ASSERT_EQ(instants.size(), 3U);
  EXPECT_EQ(instants[2].index, 2);
  EXPECT_EQ(instants[2].number, 2);
  EXPECT_TRUE(instants[2].late.empty());
}

TEST(FrameInstants, ATriggerThatBothCamerasMissedIsAGap) {
  const auto instants = instants_of(two_cameras({0, 100, 200, 400, 500}, {0, 100, 200, 400, 500}));
  ASSERT_EQ(instants.size(), 6U);
  EXPECT_EQ(instants[3].number, -1);
  EXPECT_EQ(instants[4].number, 3);
  EXPECT_EQ(instants[5].index, 5);
}

TEST(FrameInstants, OneTriggerHasOneTimeThoughClocksDiffer) {
  // The second clock is ahead by 10^6 and runs 1 % too fast; frame 2 was seen by it alone.
  const auto instants = instants_of(
      two_cameras({0, 100, no_timestamp, 320, 400}, {1'000'000, 1'000'101, 1'000'222, 1'000'323, 1'000'404}));
  ASSERT_EQ(instants.size(), 5U);
  EXPECT_NEAR(instants[3].late[0], 0.20, 1e-6);
  EXPECT_EQ(instants[3].late[0], instants[3].late[1]);
  EXPECT_NEAR(instants[2].late[1], 0.21, 0.011);  // as near as a clock 1 % fast tells over one interval
}

TEST(FrameInstants, CamerasThatRunFreelyHaveTimesOfTheirOwn) {
  Capture capture = two_cameras({0, 100, 200}, {30, 130, 230});
  capture.is_triggered = false;
  const auto instants = instants_of(capture);
  EXPECT_FLOAT_EQ(instants[1].late[0], 0);
  EXPECT_FLOAT_EQ(instants[1].late[1], 0.3F);
}

TEST(FrameInstants, RefusesAClockThatLeaps) {
  EXPECT_THROW(instants_of(two_cameras({0, 100, 200'000'000'000}, {0, 100, 200})), Error);
}

TEST(FrameInstants, ExposuresStayWithTheirFrames) {
  const auto instants = instants_of(two_cameras({0, 100, 300}, {0, 100, 300}));
  const Sequence sequence = on_instants({.camera = "cam1", .count = 3, .exposures = {1, 0.5, 0.25}}, instants);
  EXPECT_EQ(sequence.count, 4);
  EXPECT_EQ(sequence.exposures[1], 0.5);
  EXPECT_EQ(sequence.exposures[3], 0.25);
}

}  // namespace
}  // namespace pagesweep
