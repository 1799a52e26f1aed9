// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/data/trigger_times.h"

#include <gtest/gtest.h>

namespace pagesweep {
namespace {

TEST(TriggerTimes, FollowClocksThatRunApart) {
  // The second clock is 7 s ahead and gains 100 ns an interval of 10 ms; the first camera misses every third trigger.
  const std::vector<Timestamp> common{0, 7'000'000'000};
  TriggerTimes times(10e6, true, common);
  for (std::int64_t i = 0; i < 3000; ++i) {
    std::vector<Timestamp> stamps{i * 10'000'000, 7'000'000'000 + i * 10'000'100};
    if (i % 3 == 2) stamps[0].reset();
    const auto place = times.place(stamps);
    ASSERT_EQ(place->index, i);
    EXPECT_TRUE(place->late.empty()) << i;  // 100 ns are below a clock's resolution; 0.3 ms would not be
  }
}

TEST(TriggerTimes, ATriggerThatNobodySawLeavesAGap) {
  TriggerTimes times(10e6, true, std::vector<Timestamp>{0, 0});
  times.place(std::vector<Timestamp>{0, 0});
  EXPECT_FALSE(times.place(std::vector<Timestamp>{std::nullopt, std::nullopt}));
  EXPECT_EQ(times.place(std::vector<Timestamp>{20'000'000, 20'000'000})->index, 2);
}

}  // namespace
}  // namespace pagesweep
