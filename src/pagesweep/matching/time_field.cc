// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/time_field.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "pagesweep/base/parallel.h"

namespace pagesweep {
namespace {

constexpr std::uint8_t right = 1, below = 2;

/// Whether pixel (x, y) and the one at (x + dx, y + dy) are of one surface.
bool are_linked(const TimeMap& map, int x, int y, int dx, int dy) {
  const auto time = [&](int step) {
    const int column = x + step * dx, row = y + step * dy;
    return map.time.contains(column, row) ? map.time(column, row) : not_a_number;
  };
  const float here = time(0), next = time(1);
  const float difference = std::abs(next - here);
  if (!(difference < std::numeric_limits<float>::infinity())) return false;
  // A jump that the lens smears over two pixels has a steep neighbour on one side at most two pairs away, so each
  // side's flatter one of two pairs speaks for it. Missing pairs say nothing: fmin and fmax pass over NaN.
  const float left = std::fmin(std::abs(here - time(-1)), std::abs(time(-1) - time(-2)));
  const float rest = std::fmin(std::abs(time(2) - next), std::abs(time(3) - time(2)));
  const float around = std::fmax(left, rest);
  if (!(around >= 0)) return true;
  const float noise = std::hypot(map.sigma(x, y), map.sigma(x + dx, y + dy));
  return difference <= 3 * around + 6 * noise;
}

}  // namespace

TimeField::TimeField(const TimeMap& map) : map_(&map), between_(map.width(), map.height(), not_a_number) {
  Image<std::uint8_t> linked(map.width(), map.height());
  parallel_rows(map.height(), [&](int y) {
    for (int x = 0; x < map.width(); ++x) {
      const unsigned links = (are_linked(map, x, y, 1, 0) ? right : 0u) | (are_linked(map, x, y, 0, 1) ? below : 0u);
      linked(x, y) = static_cast<std::uint8_t>(links);
    }
  });
  parallel_rows(std::max(0, map.height() - 1), [&](int y) {
    for (int x = 0; x + 1 < map.width(); ++x)
      if ((linked(x, y) & right) && (linked(x, y) & below) && (linked(x + 1, y) & below) && (linked(x, y + 1) & right))
        between_(x, y) = 0;
  });
}

TimeArrays TimeField::arrays() const {
  return {map_->time.data(), map_->sigma.data(), map_->amplitude.data(),
          between_.data(),   map_->width(),      map_->height()};
}

TimeField::Cell TimeField::cell_at(const Eigen::Vector2d& pixel) const {
  const double x = std::clamp(pixel.x(), 0.0, map_->width() - 1.0);
  const double y = std::clamp(pixel.y(), 0.0, map_->height() - 1.0);
  const int column = std::min(static_cast<int>(x), std::max(0, map_->width() - 2));
  const int row = std::min(static_cast<int>(y), std::max(0, map_->height() - 2));
  return {column, row, x - column, y - row};
}

double TimeField::time_at(const Eigen::Vector2d& pixel) const {
  const Cell c = cell_at(pixel);
  if (std::isnan(between_(c.x, c.y))) return std::numeric_limits<double>::quiet_NaN();
  const float* top = &map_->time(c.x, c.y);
  const float* bottom = &map_->time(c.x, c.y + 1);
  const double upper = top[0] + c.a * (static_cast<double>(top[1]) - top[0]);
  const double lower = bottom[0] + c.a * (static_cast<double>(bottom[1]) - bottom[0]);
  return upper + c.b * (lower - upper);
}

double TimeField::amplitude_at(const Eigen::Vector2d& pixel) const {
  const Cell c = cell_at(pixel);
  const auto& amplitude = map_->amplitude;
  const double upper = (1 - c.a) * amplitude(c.x, c.y) + c.a * amplitude(c.x + 1, c.y);
  const double lower = (1 - c.a) * amplitude(c.x, c.y + 1) + c.a * amplitude(c.x + 1, c.y + 1);
  return (1 - c.b) * upper + c.b * lower;
}

double TimeField::variance_at(const Eigen::Vector2d& pixel) const {
  const Cell c = cell_at(pixel);
  const auto part = [&](int x, int y, double weight) {
    const double s = weight * map_->sigma(c.x + x, c.y + y);
    return s * s;
  };
  return part(0, 0, (1 - c.a) * (1 - c.b)) + part(1, 0, c.a * (1 - c.b)) + part(0, 1, (1 - c.a) * c.b) +
         part(1, 1, c.a * c.b);
}

}  // namespace pagesweep
