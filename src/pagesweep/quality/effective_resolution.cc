// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/quality/effective_resolution.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace pagesweep {
namespace {

constexpr double mm_per_inch = 25.4;

/// The value below which that share of the known ones lies; NaN if there is none.
double quantile(const Image<float>& values, double share) {
  std::vector<float> known;
  for (const float value : values.pixels())
    if (std::isfinite(value)) known.push_back(value);
  if (known.empty()) return not_a_number;
  const auto at = known.begin() + static_cast<std::ptrdiff_t>(share * double(known.size() - 1));
  std::nth_element(known.begin(), at, known.end());
  return *at;
}

}  // namespace

ResolutionMap map_resolution(const Page& page, double pitch_mm) {
  ResolutionMap map;
  const ScanMap& scan = page.scan_map;
  const double pixels_per_mm = page.picture.pixels_per_mm;
  map.pitch_mm = pitch_mm;
  map.page_dpi = pixels_per_mm * mm_per_inch;
  const int cell = std::max(2, static_cast<int>(std::lround(pitch_mm * pixels_per_mm)));
  const int columns = std::max(1, scan.width() / cell), rows = std::max(1, scan.height() / cell);
  map.across_dpi = map.down_dpi = Image<float>(columns, rows, not_a_number);
  const auto length = [&](int x0, int y0, int x1, int y1) {
    return std::hypot(scan.u(x1, y1) - scan.u(x0, y0), scan.v(x1, y1) - scan.v(x0, y0));
  };
  for (int j = 0; j < rows; ++j)
    for (int i = 0; i < columns; ++i) {
      const int x0 = i * cell, y0 = j * cell;
      const int x1 = std::min(x0 + cell, scan.width() - 1), y1 = std::min(y0 + cell, scan.height() - 1);
      const int x = (x0 + x1) / 2, y = (y0 + y1) / 2;
      if (x1 <= x0 || y1 <= y0) continue;
      const auto per_px = static_cast<float>(map.page_dpi);
      map.across_dpi(i, j) = per_px * length(x0, y, x1, y) / static_cast<float>(x1 - x0);
      map.down_dpi(i, j) = per_px * length(x, y0, x, y1) / static_cast<float>(y1 - y0);
    }
  map.lowest_across_dpi = quantile(map.across_dpi, 0.05);
  map.lowest_down_dpi = quantile(map.down_dpi, 0.05);
  map.typical_across_dpi = quantile(map.across_dpi, 0.5);
  map.typical_down_dpi = quantile(map.down_dpi, 0.5);
  return map;
}

}  // namespace pagesweep
