// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/pipeline/watch_board.h"

#include <gtest/gtest.h>

#include "pagesweep/timing/stripe_pixel_testing.h"

namespace pagesweep {
namespace {

/// Hands frames on one by one.
class HeldFrames final : public FrameSource {
 public:
  explicit HeldFrames(Frames frames) : frames_(std::move(frames)), sequences_{frames_.sequence()} {}
  const std::vector<Sequence>& sequences() const override { return sequences_; }
  std::optional<FrameSet> next() override {
    if (at_ == frames_.count()) return std::nullopt;
    FrameSet set{at_, {frames_.frame(at_)}};
    ++at_;
    return set;
  }

 private:
  Frames frames_;
  std::vector<Sequence> sequences_;
  int at_ = 0;
};

bool is_white(int x, int y) { return (x / 12 + y / 12) % 2 == 0; }

TEST(WatchBoard, TheTextureShowsTheBoardWithoutTheRoomsLight) {
  constexpr int width = 96, height = 72;
  const testing::Sensor sensor{.gain = 0.02, .read_noise = 1};
  const auto pixel_at = [](int x, int y) {
    // The room is brighter on the right.
    return testing::Pixel{
        .amplitude = is_white(x, y) ? 150.0 : 12.0, .background = 5 + 0.3 * x, .time = 25 + 0.8 * y + 0.1 * x};
  };
  HeldFrames frames(testing::make_frames(width, height, 120, testing::gaussian(3.5), sensor, pixel_at));
  const BoardSweep sweep = watch_board(frames);
  ASSERT_EQ(sweep.textures.size(), 1U);
  const Image<std::uint8_t>& texture = sweep.textures[0];
  ASSERT_EQ(texture.width(), width);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      // White is 230 by the brightest hundredth; a bell's height is known to a few gray values.
      if (is_white(x, y))
        EXPECT_NEAR(texture(x, y), 226, 12) << x << ", " << y;
      else
        EXPECT_NEAR(texture(x, y), 18, 8) << x << ", " << y;
    }
  EXPECT_NEAR(sweep.timing.noise[0].gain, sensor.gain, 0.005);
}

}  // namespace
}  // namespace pagesweep
