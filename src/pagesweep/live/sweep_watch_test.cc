// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/live/sweep_watch.h"

#include <gtest/gtest.h>

namespace pagesweep {
namespace {

constexpr int size = 128;

/// A noisy dark picture with a stripe 12 rows thick around row y, if that is in it.
FrameSet frame(int index, int y) {
  Image<std::uint8_t> image(size, size);
  for (int v = 0; v < size; ++v)
    for (int u = 0; u < size; ++u)
      image(u, v) = static_cast<std::uint8_t>(4 + (u * 7 + v * 13 + index * 29) % 4 + (std::abs(v - y) < 6 ? 90 : 0));
  return {index, {GrayImage(std::move(image))}};
}

SweepWatch watch() { return SweepWatch({{.camera = "cam1", .width = size, .height = size, .black_level = 4}}); }

TEST(SweepWatch, SeesTheStripeComeAndGo) {
  SweepWatch sweep = watch();
  for (int i = 0; i < 50; ++i) EXPECT_EQ(sweep.look(frame(i, -100)), SweepWatch::State::waiting);
  int begun = -1, over = -1;
  for (int i = 0; i < 200; ++i) {
    const auto state = sweep.look(frame(i, 2 * i - 20));
    if (begun < 0 && state == SweepWatch::State::sweeping) begun = i;
    if (over < 0 && state == SweepWatch::State::over) over = i;
    if (i == 42) {
      EXPECT_NEAR(sweep.position(0)->y, 0.5, 0.05);
    }
  }
  EXPECT_GE(begun, 7);  // its edge comes into view at i = 7
  EXPECT_LT(begun, 7 + frames_around_sweep / 2);
  EXPECT_GE(over, 77 + frames_around_sweep - 8);  // it leaves at i = 77
  EXPECT_LT(over, 85 + frames_around_sweep);
}

TEST(SweepWatch, AFlickerIsNoStripe) {
  SweepWatch sweep = watch();
  for (int i = 0; i < 60; ++i) EXPECT_EQ(sweep.look(frame(i, i % 20 == 7 ? 64 : -100)), SweepWatch::State::waiting);
}

TEST(SweepWatch, DamagedFramesChangeNothing) {
  SweepWatch sweep = watch();
  for (int i = 0; i < 5; ++i) sweep.look(frame(i, -100));
  for (int i = 0; i < 4; ++i) sweep.look(frame(i, 40 + i));
  for (int i = 0; i < 100; ++i) EXPECT_EQ(sweep.look({i, {std::nullopt}}), SweepWatch::State::sweeping);
}

}  // namespace
}  // namespace pagesweep
