// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "pagesweep/data/point_map.h"

namespace pagesweep {

/// A camera's points as letters, for a terminal: the higher the denser, from '.' to '@', and a blank where there is no
/// point. The range is that of the points, but 5 mm at least, so that a flat sheet looks even.
/// \return rows from top to bottom, all as long
/// \throws std::invalid_argument  if columns or rows is not above 0
std::vector<std::string> letter_relief(const PointMap& points, int columns, int rows);

}  // namespace pagesweep
