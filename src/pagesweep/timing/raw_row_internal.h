// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <variant>
#include <vector>

#include "pagesweep/data/frames.h"

namespace pagesweep {

/// One row of some consecutive frames as the sensor delivered it. In place of a dropped frame stands the one before it,
/// and before the first frame that one.
template <class T>
using RowsOf = std::vector<const T*>;
using RawRow = std::variant<RowsOf<std::uint8_t>, RowsOf<std::uint16_t>>;

/// Row y of the frames begin, begin + 1, ... before `end`.
/// \pre one of them is there
RawRow raw_row(const Frames& frames, int y, int begin, int end);

}  // namespace pagesweep
