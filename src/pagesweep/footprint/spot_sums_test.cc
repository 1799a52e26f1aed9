// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "pagesweep/base/image.h"
#include "pagesweep/base/instruction_sets_testing.h"
#include "pagesweep/footprint/spot_sums_internal.h"

namespace pagesweep {
namespace {

class SpotSumsTest : public testing::Test {
 protected:
  Image<float> light{61, 40};

  SpotSumsTest() {
    std::mt19937 random(3);
    std::uniform_real_distribution<float> uniform;
    std::ranges::generate(light.pixels(), [&] { return uniform(random); });
  }

  double light_at(double u, double v) const {
    const int x = static_cast<int>(u), y = static_cast<int>(v);
    const double a = u - x, b = v - y;
    return (1 - b) * ((1 - a) * light(x, y) + a * light(x + 1, y)) +
           b * ((1 - a) * light(x, y + 1) + a * light(x + 1, y + 1));
  }

  /// On all instruction sets, against a plain loop over the places.
  void expect_plain_sums(int left, int top, const GaussianSpot& spot) const {
    double sum = 0, u = 0, v = 0;
    for (int row = 0; row < spot.rows; row += spot.row_step)
      for (int k = 0; k < spot.parts; ++k)
        for (int column = 0; column < spot.columns * spot.parts; ++column) {
          const double i = static_cast<double>(column) / spot.parts - spot.u;
          const double j = row + static_cast<double>(k) / spot.parts - spot.v;
          const double square = spot.uu * i * i + 2 * spot.uv * i * j + spot.vv * j * j;
          if (square > spot.most) continue;
          const double weighed = std::exp(-square / 2) * light_at(left + spot.u + i, top + spot.v + j);
          sum += weighed, u += weighed * i, v += weighed * j;
        }
    ASSERT_GT(sum, 1);
    on_every_instruction_set([&] {
      const SpotSums sums = sum_spot({&light(left, top), light.width()}, spot);
      EXPECT_NEAR(sums.light, sum, 1e-4 * sum);
      EXPECT_NEAR(sums.u, u, 1e-4 * sum * spot.columns);
      EXPECT_NEAR(sums.v, v, 1e-4 * sum * spot.rows);
    });
  }
};

TEST_F(SpotSumsTest, ArePlainSumsOverThePixels) {
  expect_plain_sums(5, 7, {8.3f, 6.9f, 0.2f, 0.07f, 0.31f, 9.01f, 18, 15, 1, 1});
}

TEST_F(SpotSumsTest, OfASmallSpotLookBetweenThePixels) {
  expect_plain_sums(50, 30, {3.2f, 2.6f, 3.1f, -1.2f, 4.3f, 9.01f, 8, 6, 3, 1});
}

TEST_F(SpotSumsTest, OfANarrowSpotThatLiesAskewAreNoDifferent) {
  const GaussianSpot spot{20.3f, 18.9f, 0.5f, -0.48f, 0.5f, 9.01f, 42, 38, 1, 1};
  ASSERT_FALSE(spot.weighs_everywhere());
  expect_plain_sums(1, 0, spot);
}

TEST_F(SpotSumsTest, OfALargeSpotLeaveRowsOut) {
  expect_plain_sums(1, 0, {25.4f, 19.7f, 0.015f, 0.002f, 0.025f, 9.01f, 52, 38, 1, 4});
}

}  // namespace
}  // namespace pagesweep
