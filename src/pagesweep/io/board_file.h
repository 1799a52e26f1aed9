// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "pagesweep/data/board.h"

namespace pagesweep {

/// Reads a calibration board's definition (docs/formats.md, "Board").
/// \throws Error  that names file, field and what was expected
Board read_board(const std::filesystem::path& file);

/// \throws Error  if it cannot be written
void write_board(const std::filesystem::path& file, const Board& board);

}  // namespace pagesweep
