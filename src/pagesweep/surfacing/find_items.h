// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "pagesweep/surfacing/smooth_points.h"

namespace pagesweep {

/// Sheets that lie apart on one table: for each the cells of `paper` that belong to it, in reading order. Pieces nearer
/// than 3 mm to each other are one sheet; what is smaller than 4 square centimetres is none. Sheets are on one line if
/// they overlap by more than half of the lower one's height; lines go from the top down, sheets on them from left to
/// right.
std::vector<Image<std::uint8_t>> find_items(const HeightField& field, const Image<std::uint8_t>& paper);

}  // namespace pagesweep
