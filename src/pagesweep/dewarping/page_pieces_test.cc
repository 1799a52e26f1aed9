// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <string>
#include <string_view>
#include <vector>

#include "pagesweep/dewarping/page_pieces_internal.h"

namespace pagesweep {
namespace {

/// Cells of the chosen kinds.
Image<char> mask_of(const std::vector<std::string_view>& rows, std::string_view chosen) {
  Image<char> mask(static_cast<int>(rows[0].size()), static_cast<int>(rows.size()));
  for (int y = 0; y < mask.height(); ++y)
    for (int x = 0; x < mask.width(); ++x)
      mask(x, y) = chosen.find(rows[static_cast<std::size_t>(y)][static_cast<std::size_t>(x)]) != chosen.npos;
  return mask;
}

/// What is kept of bright cells ('b') and of bright ones that were measured ('m').
std::vector<std::string> kept(const std::vector<std::string_view>& rows) {
  const Image<char> page = keep_page_pieces(mask_of(rows, "bm"), mask_of(rows, "m"));
  std::vector<std::string> shown;
  for (int y = 0; y < page.height(); ++y) {
    shown.emplace_back();
    for (const char cell : page.row(y)) shown.back() += cell ? '#' : '.';
  }
  return shown;
}

using Rows = std::vector<std::string>;

TEST(PagePieces, ArmsThatMeetBelowAreOnePiece) {
  EXPECT_EQ(kept({"m...b.b", "b...b.b", "bbb.bbb", "..b.b..", "b.bbb.."}),  //
            (Rows{"#...#.#", "#...#.#", "###.###", "..#.#..", "..###.."}));
}

TEST(PagePieces, CornersDoNotConnect) {
  EXPECT_EQ(kept({"mm.", "mm.", "..b"}), (Rows{"##.", "##.", "..."}));  //
}

TEST(PagePieces, AnotherSheetThatWasNotMeasuredIsLeftOut) {
  EXPECT_EQ(kept({"bbbbb", ".....", "mmm.."}), (Rows{".....", ".....", "###.."}));
}

TEST(PagePieces, SmallPiecesStayOnlyIfMostlyMeasured) {
  EXPECT_EQ(kept({"mmmmmmmmmmmm", "mmmmmmmmmmmm", "............", "m.mbb.......", "............"}),
            (Rows{"############", "############", "............", "#.###.......", "............"}));
  EXPECT_EQ(kept({"mmmmmmmmmmmm", "mmmmmmmmmmmm", "mmmmmmmmmmmm", "............", "m.mbb......."}),
            (Rows{"############", "############", "############", "............", "#..........."}));
}

TEST(PagePieces, WithoutAnyMeasurementLargePiecesCount) {
  EXPECT_EQ(kept({"bbbbbbbbbbbb", "............", "b.bb........"}),
            (Rows{"############", "............", "..##........"}));
}

}  // namespace
}  // namespace pagesweep
