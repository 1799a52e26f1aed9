// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/data/frame_beat.h"

#include <gtest/gtest.h>

namespace pagesweep {
namespace {

TEST(FrameBeat, LeavesOutTheInstantsOfFramesThatWereLost) {
  FrameBeat beat(10e6);
  EXPECT_EQ(beat.place(500)->index, 0);
  EXPECT_EQ(beat.place(10'000'500)->index, 1);
  const auto after_gap = beat.place(40'000'500);
  EXPECT_EQ(after_gap->index, 4);
  EXPECT_DOUBLE_EQ(after_gap->late, 0);
}

TEST(FrameBeat, TellsHowLateAFrameWas) {
  FrameBeat beat(10e6);
  beat.place(0);
  EXPECT_DOUBLE_EQ(beat.place(12'500'000)->late, 0.25);
  EXPECT_DOUBLE_EQ(beat.place(18'000'000)->late, -0.2);
}

TEST(FrameBeat, GivesEveryFrameAnInstantOfItsOwn) {
  FrameBeat beat(10e6);
  beat.place(0);
  for (int i = 1; i < 20; ++i) {  // twice as fast as the beat
    const auto place = beat.place(i * 5'000'000);
    EXPECT_EQ(place->index, i);
    EXPECT_DOUBLE_EQ(place->index + place->late, 0.5 * i);
  }
}

TEST(FrameBeat, RefusesTimeThatStandsOrGoesBackOrLeapsAhead) {
  FrameBeat beat(10e6);
  beat.place(1'000'000'000);
  EXPECT_FALSE(beat.place(1'000'000'000));
  EXPECT_FALSE(beat.place(900'000'000));
  EXPECT_FALSE(beat.place(9'000'000'000'000'000'000));
  EXPECT_EQ(beat.place(1'010'000'000)->index, 1);
}

TEST(UsualInterval, IsNotMovedByLostFrames) {
  const std::vector<std::int64_t> timestamps{0, 10, 20, 30, 60, 70, 80, 120, 130};
  EXPECT_EQ(usual_interval_ns(timestamps), 10);
  EXPECT_EQ(usual_interval_ns({}), 0);
}

}  // namespace
}  // namespace pagesweep
