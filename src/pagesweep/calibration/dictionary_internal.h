// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/aruco/dictionary.hpp>
#include <string>

#include "pagesweep/data/board.h"

namespace pagesweep {

/// The dictionary of that name.
/// \throws std::invalid_argument  if there is none
cv::Ptr<cv::aruco::Dictionary> dictionary_named(const std::string& name);

/// A marker of a ChArUco board: the square that it stands in.
struct MarkerPlace {
  int column, row;  ///< of the square, from the lower left
};
/// The white squares of a board, in the order of their markers' numbers.
std::vector<MarkerPlace> marker_places(const Board& board);

}  // namespace pagesweep
