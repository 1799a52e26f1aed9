// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/data/linear_light.h"

#include <gtest/gtest.h>

namespace pagesweep {
namespace {

TEST(LinearLight, FollowsTheStandardsCurve) {
  Picture picture = make_picture(4, 1, 1, 8);
  auto& samples = std::get<Image<std::uint8_t>>(picture.samples);
  samples(0, 0) = 0, samples(1, 0) = 5, samples(2, 0) = 188, samples(3, 0) = 255;
  const Image<float> light = linear_light(picture);
  EXPECT_EQ(light(0, 0), 0);
  EXPECT_NEAR(light(1, 0), 5 / 255.0 / 12.92, 1e-6) << "the straight part";
  EXPECT_NEAR(light(2, 0), 0.5029, 1e-4) << "half the light";
  EXPECT_FLOAT_EQ(light(3, 0), 1);
}

TEST(LinearLight, IsTheMeanOfTheChannelsAtAnyDepth) {
  Picture picture = make_picture(1, 1, 3, 16);
  auto& samples = std::get<Image<std::uint16_t>>(picture.samples);
  samples(0, 0) = 65535, samples(1, 0) = 0, samples(2, 0) = 65535;
  EXPECT_NEAR(linear_light(picture)(0, 0), 2.0 / 3, 1e-6);
}

}  // namespace
}  // namespace pagesweep
