// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "pagesweep/data/board.h"

namespace pagesweep {

/// What has to be black on a board.
/// \throws std::invalid_argument  if there is no such board, or its dictionary has too few markers
BoardDrawing draw_board(const Board& board);

/// A sheet of paper [mm].
struct Paper {
  double width_mm = 0, height_mm = 0;
};

/// "A0" to "A6", "letter", "legal", "tabloid" or a size like "420x297"; nothing for anything else.
std::optional<Paper> paper_named(std::string_view name);

/// A board on a sheet, as files' contents, true to scale: a page of the paper's size with the pattern in the middle and
/// a ruler along each axis.
struct BoardPrint {
  std::string pdf, svg;
  Paper paper;                            ///< turned so that the board fits
  double ruler_x_mm = 0, ruler_y_mm = 0;  ///< lengths of the rulers as designed
};

/// \param paper  nothing: as large as the board needs
/// \throws std::invalid_argument  if the board cannot be made or does not fit the paper; says how much it needs
BoardPrint print_board(const Board& board, const std::optional<Paper>& paper);

}  // namespace pagesweep
