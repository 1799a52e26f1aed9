// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "pagesweep/base/image.h"
#include "pagesweep/data/board.h"

namespace pagesweep {

struct DetectionOptions {
  int fewest_corners = 12;
  double most_blur_px = 4;
  double most_clipped = 0.5;

  template <class Visitor>
  void describe(Visitor&& visit) {
    visit("fewest-corners", fewest_corners, "", "a picture that shows fewer of the board's corners is left out");
    visit("most-blur", most_blur_px, "px",
          "a picture whose edges are blurred by a Gaussian of more than this standard deviation is refused");
    visit("most-clipped", most_clipped, "", "a picture in which more of the board's white is overexposed is refused");
  }
};

/// A corner of the board where a picture shows it.
struct BoardCorner {
  int number = 0;         ///< see Board::corner_mm()
  Eigen::Vector2d pixel;  ///< [px]
};

/// What a picture shows of a board.
struct BoardView {
  std::vector<BoardCorner> corners;  ///< by number; empty if there is a problem
  std::string problem;               ///< why the picture is of no use; "" if it is
  bool wrong_board = false;          ///< the problem is what board.json says, or a mirrored picture, not the exposure
  int corners_seen = 0;              ///< found at first, before any was refused
  double blur_px = 0;                ///< median over the corners: standard deviation of the blur of edges
  double contrast = 0;               ///< median: white minus black [gray values]
  double clipped = 0;                ///< share of white samples near corners that have the highest gray value
};

/// Finds a board's corners: markers or grid with OpenCV, then each corner by its own edges, see fit_corner().
/// \param image  gray, 255 being the highest value
/// \throws std::invalid_argument  if the board is none (see problem_of(Board)) or its dictionary is unknown
BoardView detect_board(ImageView<const std::uint8_t> image, const Board& board, const DetectionOptions& options = {});

/// The names of all dictionaries that a board may have.
std::vector<std::string> dictionary_names();

}  // namespace pagesweep
