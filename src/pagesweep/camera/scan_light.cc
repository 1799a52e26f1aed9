// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/camera/scan_light.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "pagesweep/base/error.h"
#include "pagesweep/data/transfer_curve.h"

namespace pagesweep {
namespace {

constexpr double darkest_white = 0.15, brightest_white = 0.995;  // of the scan's range, in light
constexpr double most_scatter = 0.05;                            // of a cell's light: quartiles from the median

Error not_white(const std::string& why) {
  return {ErrorKind::bad_input, "this is no scan of a blank white sheet: " + why};
}

/// Median of a cell's samples of one channel, in light.
double median_of(std::vector<float>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  const float median = *middle;
  const auto low = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 4);
  std::nth_element(values.begin(), low, middle);
  if (!(median > darkest_white)) throw not_white("parts of it are dark");
  if (median > brightest_white) throw not_white("it is overexposed");
  if (median - *low > most_scatter * median) throw not_white("something is printed or lies on it");
  return median;
}

}  // namespace

std::array<double, 3> WhiteReference::at(double u, double v) const {
  const double x = std::clamp(u, 0.0, 1.0) * (columns - 1), y = std::clamp(v, 0.0, 1.0) * (rows - 1);
  const int i = std::min(static_cast<int>(x), std::max(0, columns - 2));
  const int j = std::min(static_cast<int>(y), std::max(0, rows - 2));
  const auto node = [&](int a, int b) -> const std::array<float, 3>& {
    return light[static_cast<std::size_t>(std::min(b, rows - 1)) * static_cast<std::size_t>(columns) +
                 static_cast<std::size_t>(std::min(a, columns - 1))];
  };
  std::array<double, 3> sum{};
  for (std::size_t c = 0; c < 3; ++c) {
    const double upper = node(i, j)[c] + (x - i) * (node(i + 1, j)[c] - node(i, j)[c]);
    const double lower = node(i, j + 1)[c] + (x - i) * (node(i + 1, j + 1)[c] - node(i, j + 1)[c]);
    sum[c] = upper + (y - j) * (lower - upper);
  }
  return sum;
}

WhiteReference measure_white(const Picture& sheet, double height_mm, int columns, int rows) {
  if (columns < 2 || rows < 2 || sheet.width() < 4 * columns || sheet.height() < 4 * rows)
    throw std::invalid_argument("measure_white: a cell needs at least 4 x 4 pixels");
  const TransferCurve curve = TransferCurve::of(sheet);
  WhiteReference white{height_mm, columns, rows, {}};
  std::vector<float> values;
  for (int j = 0; j < rows; ++j)
    for (int i = 0; i < columns; ++i) {
      const double half_u = 0.5 * (sheet.width() - 1) / (columns - 1), half_v = 0.5 * (sheet.height() - 1) / (rows - 1);
      const int x0 = std::max(0, static_cast<int>((2 * i - 1) * half_u));
      const int x1 = std::min(sheet.width(), static_cast<int>((2 * i + 1) * half_u) + 1);
      const int y0 = std::max(0, static_cast<int>((2 * j - 1) * half_v));
      const int y1 = std::min(sheet.height(), static_cast<int>((2 * j + 1) * half_v) + 1);
      std::array<float, 3> node{};
      for (int c = 0; c < sheet.channels; ++c) {
        values.clear();
        const int step = std::max(1, (x1 - x0) / 32);
        for (int y = y0; y < y1; y += step)
          for (int x = x0; x < x1; x += step) values.push_back(curve.light_of(sheet, x, y, c));
        const auto light = static_cast<float>(median_of(values));
        if (sheet.channels == 1)
          node.fill(light);
        else
          node[static_cast<std::size_t>(c)] = light;
      }
      white.light.push_back(node);
    }
  return white;
}

}  // namespace pagesweep
