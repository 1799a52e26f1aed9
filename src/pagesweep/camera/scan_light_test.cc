// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/camera/scan_light.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "pagesweep/base/error.h"
#include "pagesweep/data/transfer_curve.h"

namespace pagesweep {
namespace {

/// A sheet whose light falls off to the sides, with some noise.
Picture sheet(double print = 0) {
  Picture picture = make_picture(480, 360, 3, 8);
  auto& samples = std::get<Image<std::uint8_t>>(picture.samples);
  const TransferCurve srgb;
  std::mt19937 random(1);
  for (int y = 0; y < 360; ++y)
    for (int x = 0; x < 480; ++x)
      for (int c = 0; c < 3; ++c) {
        double light = (0.8 - 0.3 * std::pow((x - 239.5) / 240, 2)) * (c == 2 ? 0.9 : 1);
        if (print > 0 && (x / 3) % 2 == 0) light *= 1 - print;
        samples(3 * x + c, y) = static_cast<std::uint8_t>(255 * srgb.sample(light) + double(random() % 3));
      }
  return picture;
}

TEST(WhiteReference, IsTheLightOfABlankSheet) {
  const WhiteReference white = measure_white(sheet(), 2);
  EXPECT_EQ(white.height_mm, 2);
  for (const double u : {0.1, 0.5, 0.77}) {
    const auto light = white.at(u, 0.4);
    const double expected = 0.8 - 0.3 * std::pow(2 * u - 1, 2);
    EXPECT_NEAR(light[0], expected, 0.01) << u;
    EXPECT_NEAR(light[2], 0.9 * expected, 0.01) << u;
  }
}

TEST(WhiteReference, RefusesWhatIsNoBlankSheet) {
  EXPECT_THROW(measure_white(sheet(0.6)), Error);
  EXPECT_THROW(measure_white(make_picture(480, 360, 1, 8)), Error);  // black
  Picture bright = make_picture(480, 360, 1, 8);
  for (std::uint8_t& sample : std::get<Image<std::uint8_t>>(bright.samples).pixels()) sample = 255;
  EXPECT_THROW(measure_white(bright), Error);
  EXPECT_THROW(measure_white(sheet(), 0, 1, 18), std::invalid_argument);
}

}  // namespace
}  // namespace pagesweep
