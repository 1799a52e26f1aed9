// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/data/board.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace pagesweep {
namespace {

TEST(Board, CornersCountFromTheLowerLeft) {
  const Board board{.columns = 4, .rows = 3, .square_mm = 10, .marker_mm = 7};
  ASSERT_EQ(board.corner_count(), 6);
  EXPECT_EQ(board.corner_mm(0), Eigen::Vector2d(10, 10));
  EXPECT_EQ(board.corner_mm(2), Eigen::Vector2d(30, 10));
  EXPECT_EQ(board.corner_mm(5), Eigen::Vector2d(30, 20));
}

TEST(Board, ThePrintersScaleIsInEveryLength) {
  const Board board{.columns = 4, .rows = 3, .square_mm = 10, .marker_mm = 7, .print_scale = {0.99, 1.02}};
  EXPECT_TRUE(board.corner_mm(5).isApprox(Eigen::Vector2d(29.7, 20.4)));
  EXPECT_TRUE(board.size_mm().isApprox(Eigen::Vector2d(39.6, 30.6)));
}

TEST(Board, ABoardThatLooksTheSameUpsideDownIsRefused) {
  EXPECT_THAT(problem_of({.type = BoardType::chessboard, .columns = 9, .rows = 7}), testing::HasSubstr("upside down"));
  EXPECT_EQ(problem_of({.type = BoardType::chessboard, .columns = 9, .rows = 6}), "");
  EXPECT_THAT(problem_of({.type = BoardType::circles, .columns = 4, .rows = 10, .square_mm = 20, .marker_mm = 15}),
              testing::HasSubstr("upside down"));
}

}  // namespace
}  // namespace pagesweep
