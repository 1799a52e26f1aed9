// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/calibration/draw_board.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/aruco/charuco.hpp>

#include "pagesweep/calibration/dictionary_internal.h"

namespace pagesweep {
namespace {

using testing::HasSubstr;

bool is_black(const BoardDrawing& drawing, double x_mm, double y_mm) {
  for (const auto& r : drawing.rectangles)
    if (x_mm >= r.x_mm && x_mm < r.x_mm + r.width_mm && y_mm >= r.y_mm && y_mm < r.y_mm + r.height_mm) return true;
  return false;
}

/// Each black and white cell is where OpenCV draws it, for boards of even and odd numbers of squares.
TEST(DrawBoard, AgreesWithOpenCv) {
  for (const auto& [columns, rows, name] :
       {std::tuple{5, 4, "DICT_5X5_1000"}, {4, 5, "DICT_4X4_50"}, {7, 7, "DICT_6X6_250"}}) {
    const Board board{
        .dictionary = name, .columns = columns, .rows = rows, .square_mm = 14, .marker_mm = 7, .legacy_pattern = false};
    const BoardDrawing drawing = draw_board(board);
    const auto reference = cv::aruco::CharucoBoard::create(columns, rows, 14, 7, dictionary_named(name));
    const int px_per_mm = 4;
    cv::Mat picture;
    reference->draw({columns * 14 * px_per_mm, rows * 14 * px_per_mm}, picture);
    int differing = 0, samples = 0;
    for (double y = 0.25; y < rows * 14; y += 0.5)
      for (double x = 0.25; x < columns * 14; x += 0.5, ++samples) {
        const int u = int(x * px_per_mm), v = int((rows * 14 - y) * px_per_mm);
        differing += (picture.at<unsigned char>(v, u) < 128) != is_black(drawing, x, y);
      }
    EXPECT_LT(differing, samples / 100) << name << ": OpenCV rounds the cells of markers to whole pixels";
  }
}

TEST(DrawBoard, LegacyBoardsWithAnEvenNumberOfRowsBeginWithWhite) {
  for (const bool legacy : {false, true}) {
    const Board board{.columns = 5, .rows = 4, .square_mm = 14, .marker_mm = 7, .legacy_pattern = legacy};
    EXPECT_EQ(is_black(draw_board(board), 1, 55), !legacy);
  }
  const Board odd{.columns = 4, .rows = 5, .square_mm = 14, .marker_mm = 7};
  EXPECT_TRUE(is_black(draw_board(odd), 1, 69));
}

TEST(DrawBoard, ThereMustBeEnoughMarkers) {
  const Board board{.dictionary = "DICT_4X4_50", .columns = 25, .rows = 18};
  try {
    draw_board(board);
    FAIL() << "225 markers from 50";
  } catch (const std::invalid_argument& e) {
    EXPECT_THAT(e.what(), HasSubstr("225 markers"));
  }
}

TEST(PrintBoard, IsTrueToScale) {
  const BoardPrint print = print_board({}, paper_named("A4"));
  EXPECT_EQ(print.paper.width_mm, 297) << "turned, because the board is wider than high";
  EXPECT_THAT(print.svg, HasSubstr("width=\"297mm\" height=\"210mm\" viewBox=\"0 0 297 210\""));
  EXPECT_THAT(print.svg, HasSubstr("h7.5v7.5h-7.5z"));
  EXPECT_THAT(print.pdf, HasSubstr("/MediaBox [ 0 0 841.8897"));  // 297 mm in points of 1/72 inch
  EXPECT_EQ(print.ruler_x_mm, 180);
  EXPECT_EQ(print.ruler_y_mm, 130);
}

TEST(PrintBoard, ABoardThatDoesNotFitSaysWhatItNeeds) {
  try {
    print_board({.square_mm = 15, .marker_mm = 11}, paper_named("A4"));
    FAIL() << "375 mm on A4";
  } catch (const std::invalid_argument& e) {
    EXPECT_THAT(e.what(), testing::AllOf(HasSubstr("needs 403 mm x 298 mm"), HasSubstr("210 mm x 297 mm")));
  }
}

TEST(PaperNamed, KnowsFormatsAndSizes) {
  EXPECT_EQ(paper_named("A3")->height_mm, 420);
  EXPECT_EQ(paper_named("500x400")->width_mm, 500);
  for (const char* bad : {"A9", "", "500", "500x", "500x400mm", "-5x20", "nanxnan", "1e9x20"})
    EXPECT_FALSE(paper_named(bad)) << bad;
}

}  // namespace
}  // namespace pagesweep
