// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/live/letter_relief.h"

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <string_view>

namespace pagesweep {
namespace {

constexpr std::string_view letters = ".:-=+*#%@";
constexpr float least_range_mm = 5;

}  // namespace

std::vector<std::string> letter_relief(const PointMap& points, int columns, int rows) {
  if (columns < 1 || rows < 1) throw std::invalid_argument("letter_relief: no columns or rows");
  Image<float> heights(columns, rows);
  Image<std::uint8_t> is_there(columns, rows, 0);
  float low = std::numeric_limits<float>::infinity(), high = -low;
  for (int y = 0; y < rows; ++y)
    for (int x = 0; x < columns; ++x) {
      const int u = (2 * x + 1) * points.width() / (2 * columns), v = (2 * y + 1) * points.height() / (2 * rows);
      if (points.status(u, v) != PixelStatus::ok) continue;
      is_there(x, y) = 1;
      const float z = heights(x, y) = points.z(u, v);
      low = std::min(low, z), high = std::max(high, z);
    }
  const float step = std::max(high - low, least_range_mm) / static_cast<float>(letters.size());
  std::vector<std::string> relief(static_cast<std::size_t>(rows), std::string(static_cast<std::size_t>(columns), ' '));
  for (int y = 0; y < rows; ++y)
    for (int x = 0; x < columns; ++x)
      if (is_there(x, y)) {
        const auto level = static_cast<std::size_t>((heights(x, y) - low) / step);
        relief[static_cast<std::size_t>(y)][static_cast<std::size_t>(x)] = letters[std::min(level, letters.size() - 1)];
      }
  return relief;
}

}  // namespace pagesweep
