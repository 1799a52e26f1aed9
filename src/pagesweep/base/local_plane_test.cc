// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/base/local_plane.h"

#include <gtest/gtest.h>

#include <limits>

namespace pagesweep {
namespace {

constexpr float nan = std::numeric_limits<float>::quiet_NaN();

Image<float> ramp() {
  Image<float> image(20, 20);
  for (int y = 0; y < 20; ++y)
    for (int x = 0; x < 20; ++x) image(x, y) = 100 + 0.5f * static_cast<float>(x) - 0.25f * static_cast<float>(y);
  return image;
}

TEST(Neighbourhood, FitsAPlaneExactlyAlsoAtBordersAndBesideHoles) {
  Image<float> image = ramp();
  image(9, 10) = nan;
  for (const auto& [x, y] : {std::pair{10, 10}, {0, 0}, {19, 7}}) {
    Neighbourhood around;
    around.gather(image, x, y, 3);
    const auto plane = around.fit();
    ASSERT_TRUE(plane);
    EXPECT_NEAR(plane->across, 0.5, 1e-5);
    EXPECT_NEAR(plane->down, -0.25, 1e-5);
    EXPECT_NEAR(plane->middle, 0, 1e-5);
  }
}

TEST(Neighbourhood, LeavesAnotherSurfaceOut) {
  Image<float> image = ramp();
  for (int y = 12; y < 20; ++y)
    for (int x = 12; x < 20; ++x) image(x, y) += 1;
  Neighbourhood around;
  around.gather(image, 10, 10, 3);
  EXPECT_GT(std::abs(around.fit()->across - 0.5), 0.05);
  EXPECT_NEAR(around.fit_robustly()->across, 0.5, 1e-4);
}

TEST(Neighbourhood, RefusesTooFewValuesAndALine) {
  Image<float> line(20, 20, nan);
  for (int x = 0; x < 20; ++x) line(x, 10) = 1;
  Neighbourhood around;
  around.gather(line, 10, 10, 3);
  EXPECT_EQ(around.size(), 7u);
  EXPECT_FALSE(around.fit());
}

}  // namespace
}  // namespace pagesweep
