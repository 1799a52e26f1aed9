// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/live/letter_relief.h"

#include <gmock/gmock.h>

#include <functional>

namespace pagesweep {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;

/// \param height  [mm] of column and row; NaN: no point
PointMap map_of(int width, int height, const std::function<float(int, int)>& z) {
  PointMap points(width, height);
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u) {
      points.z(u, v) = z(u, v);
      points.status(u, v) = std::isfinite(z(u, v)) ? PixelStatus::ok : PixelStatus::too_dark;
    }
  return points;
}

TEST(LetterRelief, ARampGoesThroughAllLetters) {
  const PointMap ramp = map_of(90, 4, [](int u, int) { return static_cast<float>(u); });
  EXPECT_THAT(letter_relief(ramp, 9, 2), ElementsAre(".:-=+*#%@", ".:-=+*#%@"));
}

TEST(LetterRelief, AFlatSheetLooksEvenWhateverItsNoise) {
  const PointMap flat = map_of(64, 64, [](int u, int v) { return 100 + 0.1F * static_cast<float>((u * 7 + v) % 5); });
  EXPECT_THAT(letter_relief(flat, 8, 4), Each("........"));
}

TEST(LetterRelief, WhatTheStripeHasNotReachedIsBlank) {
  const PointMap half = map_of(40, 40, [](int, int v) { return v < 20 ? 1.0F : not_a_number; });
  EXPECT_THAT(letter_relief(half, 4, 4), ElementsAre("....", "....", "    ", "    "));
  const PointMap nothing = map_of(40, 40, [](int, int) { return not_a_number; });
  EXPECT_THAT(letter_relief(nothing, 4, 2), Each("    "));
}

TEST(LetterRelief, ARidgeIsWhereItIs) {
  const PointMap ridge = map_of(60, 60, [](int u, int) { return u / 12 == 3 ? 20.0F : 0.0F; });
  EXPECT_THAT(letter_relief(ridge, 5, 2), Each("...@."));
}

}  // namespace
}  // namespace pagesweep
