// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/data/board.h"

#include <cmath>

namespace pagesweep {
namespace {

constexpr int most_squares = 200;
constexpr double smallest_mm = 0.1, largest_mm = 1000;

bool is_length(double mm) { return std::isfinite(mm) && mm >= smallest_mm && mm <= largest_mm; }

/// Turned upside down, a board must look different, or nobody could tell which of its corners is which.
std::string problem_of_symmetry(const Board& board) {
  if (board.type == BoardType::chessboard && (board.columns + board.rows) % 2 == 0)
    return "looks the same upside down: one of the two numbers of squares must be even and the other odd";
  if (board.type == BoardType::circles && board.rows % 2 == 0)
    return "looks the same upside down: the number of rows must be odd";
  return "";
}

}  // namespace

int Board::corner_count() const { return type == BoardType::circles ? columns * rows : (columns - 1) * (rows - 1); }

Eigen::Vector2d Board::corner_mm(int corner) const {
  const int across = type == BoardType::circles ? columns : columns - 1;
  const int i = corner % across, j = corner / across;
  // Of circles, the top row and every second one below it begin at the left; the number of rows is odd.
  const Eigen::Vector2d place =
      type == BoardType::circles ? Eigen::Vector2d(2 * i + j % 2, j) : Eigen::Vector2d(i + 1, j + 1);
  return square_mm * place.cwiseProduct(print_scale);
}

Eigen::Vector2d Board::size_mm() const {
  const Eigen::Vector2d squares =
      type == BoardType::circles ? Eigen::Vector2d(2 * columns - 1, rows - 1) : Eigen::Vector2d(columns, rows);
  return square_mm * squares.cwiseProduct(print_scale);
}

bool Board::is_black(int column, int row) const {
  const int from = type == BoardType::charuco && !legacy_pattern ? rows - 1 : 0;  // a row that begins with black
  return (column + row + from) % 2 == 0;
}

Eigen::Vector2d Board::middle_mm() const { return 0.5 * size_mm(); }

std::string problem_of(const Board& board) {
  const bool circles = board.type == BoardType::circles;
  if (board.columns < (circles ? 2 : 3) || board.rows < 3 || board.columns > most_squares || board.rows > most_squares)
    return "has too few or too many squares";
  if (!is_length(board.square_mm)) return "has squares of no sensible size";
  if (board.type != BoardType::chessboard && !is_length(board.marker_mm)) return "has markers of no sensible size";
  if (board.type == BoardType::charuco && board.marker_mm >= board.square_mm) return "has markers larger than squares";
  if (circles && board.marker_mm >= board.square_mm * std::sqrt(2.0)) return "has circles that touch each other";
  for (const double scale : {board.print_scale.x(), board.print_scale.y()})
    if (!(scale > 0.5 && scale < 2)) return "was printed at a scale that cannot be meant";
  return problem_of_symmetry(board);
}

}  // namespace pagesweep
