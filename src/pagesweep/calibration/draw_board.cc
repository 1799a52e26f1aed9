// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/calibration/draw_board.h"

#include <fmt/format.h>

#include <opencv2/core.hpp>
#include <stdexcept>

#include "pagesweep/calibration/dictionary_internal.h"

namespace pagesweep {
namespace {

void require_sound(const Board& board) {
  if (const std::string problem = problem_of(board); !problem.empty())
    throw std::invalid_argument("the board " + problem);
}

void draw_squares(const Board& board, BoardDrawing& drawing) {
  const double side = board.square_mm;
  for (int row = 0; row < board.rows; ++row)
    for (int column = 0; column < board.columns; ++column)
      if (board.is_black(column, row)) drawing.rectangles.push_back({column * side, row * side, side, side});
}

/// A marker's black: its border, and runs of black cells.
/// \param x_mm, y_mm  of its lower left corner
void draw_marker(const cv::Mat& bits, double x_mm, double y_mm, double side_mm, BoardDrawing& drawing) {
  const int cells = bits.rows + 2;
  const double cell = side_mm / cells;
  const auto is_black = [&](int i, int j) {  // j from the top
    const bool border = i == 0 || j == 0 || i == cells - 1 || j == cells - 1;
    return border || bits.at<unsigned char>(j - 1, i - 1) == 0;
  };
  for (int j = 0; j < cells; ++j)
    for (int i = 0; i < cells; ++i) {
      const int begin = i;
      while (i < cells && is_black(i, j)) ++i;
      if (i > begin)
        drawing.rectangles.push_back({x_mm + begin * cell, y_mm + (cells - 1 - j) * cell, (i - begin) * cell, cell});
    }
}

void draw_markers(const Board& board, BoardDrawing& drawing) {
  const auto dictionary = dictionary_named(board.dictionary);
  const auto places = marker_places(board);
  if (static_cast<std::size_t>(dictionary->bytesList.rows) < places.size())
    throw std::invalid_argument(fmt::format("the board needs {} markers, and {} has only {}", places.size(),
                                            board.dictionary, dictionary->bytesList.rows));
  const double margin = 0.5 * (board.square_mm - board.marker_mm);
  for (std::size_t number = 0; number < places.size(); ++number) {
    const int row = static_cast<int>(number);
    const cv::Mat bits = cv::aruco::Dictionary::getBitsFromByteList(dictionary->bytesList.rowRange(row, row + 1),
                                                                    dictionary->markerSize);
    draw_marker(bits, places[number].column * board.square_mm + margin, places[number].row * board.square_mm + margin,
                board.marker_mm, drawing);
  }
}

}  // namespace

BoardDrawing draw_board(const Board& board) {
  require_sound(board);
  Board designed = board;
  designed.print_scale = {1, 1};
  BoardDrawing drawing;
  const Eigen::Vector2d size = designed.size_mm();
  drawing.width_mm = size.x(), drawing.height_mm = size.y();
  if (board.type == BoardType::circles) {
    for (int corner = 0; corner < board.corner_count(); ++corner) {
      const Eigen::Vector2d middle = designed.corner_mm(corner);
      drawing.discs.push_back({middle.x(), middle.y(), 0.5 * board.marker_mm});
    }
    return drawing;
  }
  draw_squares(board, drawing);
  if (board.type == BoardType::charuco) draw_markers(board, drawing);
  return drawing;
}

}  // namespace pagesweep
