// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "pagesweep/base/enum_names.h"

namespace pagesweep {

/// What is printed on a calibration board.
enum class BoardType {
  charuco,     ///< a chessboard whose white squares hold numbered markers: a part of it is enough
  chessboard,  ///< must be seen whole
  circles,     ///< asymmetric grid of dark circles; must be seen whole
};
constexpr auto names_of(BoardType) { return std::array<std::string_view, 3>{"charuco", "chessboard", "circles"}; }

/// A flat calibration target.
///
/// Board frame: x to the right and y up as printed, z out of the paper, right-handed; origin at the lower left corner
/// of the lower left square (of the lower left circle's centre for circles); millimetres.
///
/// Squares are counted from there, and markers row by row from the upper left, as OpenCV does. With an even number of
/// rows there are two kinds of ChArUco boards: with a white square at the upper left, as OpenCV made them before
/// version 4.6, and with a black one, as it did from then on. With an odd number both are the same.
struct Board {
  BoardType type = BoardType::charuco;
  std::string dictionary = "DICT_5X5_1000";  ///< of the markers, by OpenCV's name
  int columns = 25, rows = 18;               ///< squares; for circles: circles in a row, and rows
  double square_mm = 7.5;  ///< side of a square as designed; for circles: distance of rows, half that within a row
  double marker_mm = 5.6;  ///< side of a marker as designed; for circles: their diameter
  Eigen::Vector2d print_scale = {1, 1};  ///< printed over designed length, along x and y
  bool legacy_pattern = true;            ///< of ChArUco boards: the lower left square is black in any case

  /// Whether square (column, row) is black.
  bool is_black(int column, int row) const;

  /// Where squares meet, or circles: what is looked for in pictures.
  int corner_count() const;
  /// [mm] board frame, z = 0. Corner numbers run along x first, from the origin.
  Eigen::Vector2d corner_mm(int corner) const;
  /// [mm] from the pattern's lower left to its upper right end.
  Eigen::Vector2d size_mm() const;
  /// The middle of all corners [mm].
  Eigen::Vector2d middle_mm() const;
};

/// What is wrong with a board; "" if it can be made and found.
std::string problem_of(const Board& board);

/// What has to be printed to get a board: its black, in designed millimetres from the pattern's lower left end, y up.
struct BoardDrawing {
  struct Rectangle {
    double x_mm, y_mm, width_mm, height_mm;
  };
  struct Disc {
    double x_mm, y_mm, radius_mm;
  };
  double width_mm = 0, height_mm = 0;  ///< of the pattern
  std::vector<Rectangle> rectangles;   ///< without overlap
  std::vector<Disc> discs;
};

}  // namespace pagesweep
