// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/data/frames.h"

#include <gtest/gtest.h>

#include <cmath>

namespace pagesweep {
namespace {

Frames three_frames_with_the_middle_one_dropped() {
  Frames frames({.camera = "cam1", .width = 2, .height = 1, .count = 3, .black_level = 2, .saturation = 250});
  Image<std::uint8_t> image(2, 1);
  image(0, 0) = 12;
  image(1, 0) = 250;
  frames.set(0, image);
  frames.set(2, std::move(image));
  return frames;
}

TEST(Frames, RowsComeWithoutBlackLevelAndSayWhatIsNoMeasurement) {
  const Frames frames = three_frames_with_the_middle_one_dropped();
  Image<float> samples;
  frames.read_row(0, samples);
  ASSERT_EQ(samples.width(), 2);
  ASSERT_EQ(samples.height(), 3);
  EXPECT_EQ(samples(0, 0), 10);
  EXPECT_TRUE(std::isinf(samples(1, 0))) << "clipped";
  EXPECT_TRUE(std::isnan(samples(0, 1))) << "dropped";
  EXPECT_EQ(samples(0, 2), 10);
  EXPECT_EQ(frames.dropped(), 1);
}

TEST(Frames, TheBrightestGrayValueCountsClippedOnesAsSaturation) {
  const Image<float> picture = brightest(three_frames_with_the_middle_one_dropped());
  EXPECT_EQ(picture(0, 0), 10);
  EXPECT_EQ(picture(1, 0), 248);
}

TEST(Frames, CountsTheFramesInWhichAPixelIsClipped) {
  const auto counts = count_clipped(three_frames_with_the_middle_one_dropped());
  EXPECT_EQ(counts(0, 0), 0);
  EXPECT_EQ(counts(1, 0), 2);
}

TEST(Frames, SamplesOfAllExposuresAreWhatTheLongestWouldShow) {
  Frames frames({.camera = "cam1",
                 .width = 1,
                 .height = 1,
                 .count = 3,
                 .black_level = 2,
                 .saturation = 250,
                 .exposures = relative_exposures(std::vector{2.0, 8.0}, 3)});
  frames.set(0, Image<std::uint8_t>(1, 1, 27));
  frames.set(1, Image<std::uint8_t>(1, 1, 102));
  frames.set(2, Image<std::uint8_t>(1, 1, 250));
  Image<float> samples;
  frames.read_row(0, samples);
  EXPECT_EQ(samples(0, 0), 100);
  EXPECT_EQ(samples(0, 1), 100);
  EXPECT_TRUE(std::isinf(samples(0, 2))) << "clipped";
  EXPECT_EQ(brightest(frames)(0, 0), 4 * 248);
}

TEST(Frames, ExposuresAreRelativeToTheLongestAndRepeat) {
  EXPECT_EQ(relative_exposures(std::vector{1.0, 4.0}, 5), (std::vector{0.25, 1.0, 0.25, 1.0, 0.25}));
  EXPECT_TRUE(relative_exposures(std::vector{3.0}, 5).empty());
  EXPECT_TRUE(relative_exposures(std::vector{3.0, 3.0}, 5).empty());
  EXPECT_TRUE(relative_exposures({}, 5).empty());
  EXPECT_THROW(Frames({.camera = "cam1", .count = 3, .exposures = {1, 0.5}}), std::invalid_argument);
}

TEST(Frames, RefuseAFrameThatDoesNotFit) {
  Frames frames({.camera = "cam1", .width = 2, .height = 1, .count = 1});
  EXPECT_THROW(frames.set(0, Image<std::uint8_t>(3, 1)), std::invalid_argument);
  EXPECT_THROW(frames.set(1, Image<std::uint8_t>(2, 1)), std::invalid_argument);
}

class TwoCameras : public FrameSource {
 public:
  const std::vector<Sequence>& sequences() const override { return sequences_; }
  std::optional<FrameSet> next() override {
    if (index_ == 2) return std::nullopt;
    FrameSet set{index_++, {}};
    set.images.emplace_back(Image<std::uint8_t>(1, 1, static_cast<std::uint8_t>(index_)));
    set.images.emplace_back(std::nullopt);
    return set;
  }

 private:
  std::vector<Sequence> sequences_{{.camera = "a", .width = 1, .height = 1, .count = 2},
                                   {.camera = "b", .width = 1, .height = 1, .count = 2}};
  int index_ = 0;
};

TEST(ReadAll, KeepsTheFramesOfEachCameraAndTheirGaps) {
  TwoCameras source;
  const auto cameras = read_all(source);
  ASSERT_EQ(cameras.size(), 2u);
  EXPECT_EQ(cameras[0].dropped(), 0);
  EXPECT_EQ(cameras[1].dropped(), 2);
  EXPECT_EQ(std::get<0>(cameras[0].frame(1))(0, 0), 2);
}

}  // namespace
}  // namespace pagesweep
