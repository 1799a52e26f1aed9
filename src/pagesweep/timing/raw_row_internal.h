// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <variant>
#include <vector>

#include "pagesweep/data/frames.h"

namespace pagesweep {

/// One row of every frame as the sensor delivered it, with further entries before the first and after the last. In
/// place of a dropped frame stands the one before it, and beyond the ends the nearest.
template <class T>
using RowsOf = std::vector<const T*>;
using RawRow = std::variant<RowsOf<std::uint8_t>, RowsOf<std::uint16_t>>;

/// Whether the frames can be read that way: of one depth and one exposure.
bool are_uniform(const Frames& frames);

/// \param pad  entries to add at either end
/// \pre are_uniform(frames)
RawRow raw_row(const Frames& frames, int y, int pad);

}  // namespace pagesweep
