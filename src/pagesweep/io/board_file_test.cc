// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/board_file.h"

#include "pagesweep/io/files_testing.h"

namespace pagesweep {
namespace {

using test::error_of, test::put, test::read_text, test::replaced, test::TestFolder;
using testing::AllOf, testing::HasSubstr;

TEST(BoardFile, KeepsEverythingThatItsTypeHas) {
  const TestFolder folder;
  for (const Board& board : {Board{BoardType::charuco, "DICT_4X4_100", 7, 6, 30.5, 20.25, {0.998, 1.003}},
                             Board{BoardType::chessboard, "", 9, 6, 12, 0, {1, 1}},
                             Board{BoardType::circles, "", 4, 11, 20, 15, {1, 0.99}}}) {
    write_board(folder / "board.json", board);
    const Board read = read_board(folder / "board.json");
    EXPECT_EQ(read.type, board.type);
    EXPECT_EQ(read.columns, board.columns);
    EXPECT_EQ(read.rows, board.rows);
    EXPECT_EQ(read.square_mm, board.square_mm);
    EXPECT_EQ(read.print_scale, board.print_scale);
    EXPECT_EQ(read.dictionary, board.type == BoardType::charuco ? board.dictionary : Board().dictionary);
    EXPECT_EQ(read.marker_mm, board.type == BoardType::chessboard ? Board().marker_mm : board.marker_mm);
  }
}

TEST(BoardFile, AProblemIsNamedWithFileAndField) {
  const TestFolder folder;
  write_board(folder / "board.json", {});
  const std::string sound = read_text(folder / "board.json");
  const auto complaint = [&](const std::string& from, const std::string& to) {
    put(folder / "bad.json", replaced(sound, from, to));
    return error_of([&] { read_board(folder / "bad.json"); });
  };
  EXPECT_THAT(complaint("charuco", "dots"), AllOf(HasSubstr("bad.json: type"), HasSubstr("chessboard")));
  EXPECT_THAT(complaint("[25, 18]", "[25]"), HasSubstr("bad.json: squares: expected 2 numbers"));
  EXPECT_THAT(complaint("[25, 18]", "[25, 1e9]"), HasSubstr("squares[1]"));
  EXPECT_THAT(complaint("5.6", "9"), HasSubstr("markers larger than squares"));
  EXPECT_THAT(complaint("[1.0, 1.0]", "[1.0, 30]"), HasSubstr("scale"));
}

}  // namespace
}  // namespace pagesweep
