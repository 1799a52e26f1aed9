// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/live/pair_frames.h"

#include <gtest/gtest.h>

namespace pagesweep {
namespace {

using std::chrono::microseconds;

constexpr std::int64_t interval_ns = 10'000'000;

/// Two cameras whose second clock is ahead, and frames that are held up on their way.
class TwoCameras {
 public:
  void send(std::size_t camera, std::int64_t trigger, int delay_us) {
    LiveFrame frame;
    frame.number = trigger;
    frame.timestamp_ns = trigger * interval_ns + (camera == 0 ? 0 : 5'000'000'123);
    frame.arrival = Clock::time_point() + std::chrono::nanoseconds(trigger * interval_ns) + microseconds(delay_us);
    now_ = std::max(now_, frame.arrival);
    pairing_.add(camera, std::move(frame));
  }
  std::optional<Trigger> next(bool ended = false) { return pairing_.next(now_, ended); }
  void wait(std::chrono::milliseconds time) { now_ += time; }
  FramePairing& pairing() { return pairing_; }

 private:
  FramePairing pairing_{2, 0};
  Clock::time_point now_;
};

TEST(FrameCounter, WrapsFrom65535To1) {
  FrameCounter counter;
  EXPECT_EQ(counter.count(65534), 0);
  EXPECT_EQ(counter.count(65535), 1);
  EXPECT_EQ(counter.count(1), 2);
  EXPECT_EQ(counter.count(4), 5);
  EXPECT_EQ(counter.count(3), 4);  // was overtaken
  EXPECT_EQ(counter.total(), 6);
}

TEST(FrameCounter, DoesNotWrapWhereIdsAreLonger) {
  FrameCounter counter;
  EXPECT_EQ(counter.count(65535), 0);
  EXPECT_EQ(counter.count(65536), 1);
  EXPECT_EQ(counter.count(70000), 4465);
}

TEST(FramePairing, FindsPartnersThoughClocksStartAnywhereAndOneCameraStartedLater) {
  TwoCameras cameras;
  for (int trigger = 0; trigger < 40; ++trigger) {
    cameras.send(0, trigger, 700 + trigger * 7919 % 6000);  // up to 6 ms of 10
    if (trigger >= 5) cameras.send(1, trigger, 900 + trigger * 104729 % 6000);
  }
  int whole = 0, alone = 0;
  while (const auto trigger = cameras.next(true)) {
    if (trigger->frames[0] && trigger->frames[1]) {
      ++whole;
      EXPECT_EQ(trigger->frames[0]->number, trigger->frames[1]->number);
    } else {
      ++alone;
    }
  }
  EXPECT_EQ(whole, 35);
  EXPECT_EQ(alone, 5);
  EXPECT_EQ(cameras.pairing().ahead_ns(1), 5'000'000'123);
  EXPECT_DOUBLE_EQ(cameras.pairing().interval_ns(), interval_ns);
}

TEST(FramePairing, AFrameWhosePartnerWasLostComesAloneAndIsCounted) {
  TwoCameras cameras;
  for (int trigger = 0; trigger < 30; ++trigger) {
    cameras.send(0, trigger, 800);
    if (trigger != 20) cameras.send(1, trigger, 900);
  }
  for (int trigger = 0; trigger < 30; ++trigger) {
    const auto found = cameras.next();
    ASSERT_TRUE(found);
    EXPECT_EQ(found->frames[1].has_value(), trigger != 20) << trigger;
  }
  EXPECT_EQ(cameras.pairing().counts()[0].unpaired, 1);
  EXPECT_EQ(cameras.pairing().counts()[1].unpaired, 0);
}

TEST(FramePairing, WaitsForAPartnerButNotForever) {
  TwoCameras cameras;
  for (int trigger = 0; trigger < 20; ++trigger)
    for (std::size_t c = 0; c < 2; ++c) cameras.send(c, trigger, 800);
  while (cameras.next()) {
  }
  cameras.send(0, 20, 800);
  EXPECT_FALSE(cameras.next());
  cameras.wait(std::chrono::milliseconds(300));
  const auto alone = cameras.next();
  ASSERT_TRUE(alone);
  EXPECT_FALSE(alone->frames[1]);
  cameras.send(1, 20, 800);  // after all
  cameras.send(0, 21, 800);
  cameras.send(1, 21, 800);
  EXPECT_TRUE(cameras.next()->frames[1]);
  EXPECT_EQ(cameras.pairing().counts()[1].late, 1);
}

}  // namespace
}  // namespace pagesweep
