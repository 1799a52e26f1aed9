// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/sequence_landings.h"

#include <gtest/gtest.h>

namespace pagesweep {
namespace {

/// Three frames of a picture, no two pixels alike.
SequenceStore store_of(int width, int height, bool along_rows) {
  Frames frames(Sequence{.camera = "cam", .width = width, .height = height, .count = 3});
  for (int i = 0; i < frames.count(); ++i) {
    Image<std::uint8_t> image(width, height);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) image(x, y) = static_cast<std::uint8_t>((x * (i + 1) * 7 + y * 13) % 251);
    frames.set(i, image);
  }
  return {frames, {0, 1, 2}, along_rows, {}};
}

/// Parameter: whether lines are rows.
class SequenceLandingsTest : public testing::TestWithParam<bool> {
 protected:
  static constexpr int size = 60;
  SequenceStore from = store_of(size, size, GetParam()), there = store_of(size, size, GetParam());
  SequenceLandings landings{from, there};

  int index(int line, int place) const { return from.arrays().index(line, place); }
  void land(int line, int place, double there_line, double there_place, SequenceLandings& where) {
    if (GetParam())
      where.land(index(line, place), there_place, there_line);
    else
      where.land(index(line, place), there_line, there_place);
  }
  void land(int line, int place, double there_line, double there_place) {
    land(line, place, there_line, there_place, landings);
  }
};

TEST_P(SequenceLandingsTest, TheWayBackEndsWhereItBegan) {
  land(20, 31, 18, 24.25);
  // A step here is about a step there, and the pixel is a quarter before where the match landed.
  for (const int step : {-1, 0, 1}) {
    const auto origin = landings.origin(index(18, 24 + step));
    ASSERT_TRUE(origin.has_value());
    EXPECT_NEAR(*origin, 30.75 + step, 1e-3);
  }
  EXPECT_TRUE(landings.origin(index(17, 24)).has_value());
  EXPECT_FALSE(landings.origin(index(16, 24)).has_value());
  EXPECT_FALSE(landings.origin(index(18, 27)).has_value());
}

TEST_P(SequenceLandingsTest, NothingIsKnownWhereTwoPlacesCompete) {
  land(20, 31, 18, 24);
  land(20, 32, 18, 25);  // neighbours do not
  ASSERT_TRUE(landings.origin(index(18, 24)).has_value());
  land(21, 40, 18, 25);
  EXPECT_FALSE(landings.origin(index(18, 24)).has_value());
  EXPECT_FALSE(landings.origin(index(18, 26)).has_value());
  EXPECT_FALSE(landings.origin(index(17, 25)).has_value());
}

TEST_P(SequenceLandingsTest, NothingIsKnownWhereAPlaceMightHaveMatched) {
  land(5, 9, 6, 10);
  ASSERT_TRUE(landings.origin(index(6, 10)).has_value());
  landings.contest(GetParam() ? 11 : 6, GetParam() ? 6 : 11);
  EXPECT_FALSE(landings.origin(index(6, 10)).has_value());
}

TEST_P(SequenceLandingsTest, TheOrderDoesNotMatter) {
  SequenceLandings backwards(from, there);
  land(20, 31, 18, 24);
  land(20, 33, 18, 24.4);
  land(20, 33, 18, 24.4, backwards);
  land(20, 31, 18, 24, backwards);
  ASSERT_TRUE(landings.origin(index(18, 24)).has_value());
  EXPECT_EQ(landings.origin(index(18, 24)), backwards.origin(index(18, 24)));
}

TEST_P(SequenceLandingsTest, CornersOfThePictureAndPlacesOutsideAreHarmless) {
  land(0, 0, 0, 0);
  land(size - 1, size - 1, size - 1, size - 1);
  land(3, 3, -2, 5);
  land(3, 3, 5, size + 3);
  EXPECT_NEAR(landings.origin(index(0, 0)).value(), 0, 1e-3);
  EXPECT_NEAR(landings.origin(index(size - 1, size - 1)).value(), size - 1, 1e-3);
}

INSTANTIATE_TEST_SUITE_P(Lines, SequenceLandingsTest, testing::Bool(),
                         [](const auto& test) { return test.param ? "Rows" : "Columns"; });

}  // namespace
}  // namespace pagesweep
