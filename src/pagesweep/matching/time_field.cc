// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/time_field.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "pagesweep/base/parallel.h"

namespace pagesweep {
namespace {

constexpr std::uint8_t right = 1, below = 2;
constexpr float infinity = std::numeric_limits<float>::infinity();

int blocks_over(int pixels) { return (pixels + time_block_px - 1) / time_block_px; }

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
  if (!(around >= 0) || difference <= 3 * around) return true;
  const float noise = std::hypot(map.sigma(x, y), map.sigma(x + dx, y + dy));
  return difference <= 3 * around + 6 * noise;
}

/// Columns of a row.
struct Columns {
  int begin = std::numeric_limits<int>::max(), end = 0;
};

/// In each row, the columns that are within `reach` pixels of one of the set.
std::vector<Columns> around(const PixelSet* set, int width, int height, int reach) {
  const auto rows = static_cast<std::size_t>(height);
  if (!set) return std::vector<Columns>(rows, {0, width});
  std::vector<Columns> of_set(rows), wider(rows);
  for (int y = 0; y < height; ++y) {
    const auto row = set->row(y);
    const auto is_in = [](std::uint8_t part) { return part != 0; };
    const auto first = std::ranges::find_if(row, is_in);
    if (first == row.end()) continue;
    const auto last = std::find_if(row.rbegin(), row.rend(), is_in);
    of_set[static_cast<std::size_t>(y)] = {static_cast<int>(first - row.begin()), static_cast<int>(row.rend() - last)};
  }
  for (int y = 0; y < height; ++y)
    for (int other = std::max(0, y - reach); other <= std::min(y + reach, height - 1); ++other) {
      const Columns& columns = of_set[static_cast<std::size_t>(other)];
      if (columns.end == 0) continue;
      Columns& here = wider[static_cast<std::size_t>(y)];
      here.begin = std::min(here.begin, std::max(0, columns.begin - reach));
      here.end = std::max(here.end, std::min(columns.end + reach, width));
    }
  return wider;
}

}  // namespace

TimeField::TimeField(int width, int height)
    : linked_(width, height),
      earliest_(blocks_over(width), blocks_over(height), infinity),
      latest_(blocks_over(width), blocks_over(height), -infinity),
      earliest_around_(earliest_),
      latest_around_(latest_),
      between_(width, height, not_a_number) {}

TimeField::TimeField(const TimeMap& map) : TimeField(map.width(), map.height()) { update(map, nullptr); }

void TimeField::update(const TimeMap& map, const PixelSet* news) {
  map_ = &map;
  constexpr int reach = 3;  // [px] from a pixel whose link depends on another
  bound_blocks(news);
  const auto to_link = around(news, map.width(), map.height(), reach);
  parallel_rows(map.height(), [&](int y) {
    const Columns& columns = to_link[static_cast<std::size_t>(y)];
    for (int x = columns.begin; x < columns.end; ++x) {
      const unsigned links = (are_linked(map, x, y, 1, 0) ? right : 0u) | (are_linked(map, x, y, 0, 1) ? below : 0u);
      linked_(x, y) = static_cast<std::uint8_t>(links);
    }
  });
  const auto to_join = around(news, map.width(), map.height(), reach + 1);
  parallel_rows(std::max(0, map.height() - 1), [&](int y) {
    const Columns& columns = to_join[static_cast<std::size_t>(y)];
    for (int x = columns.begin; x < std::min(columns.end, map.width() - 1); ++x) {
      const bool all = (linked_(x, y) & right) && (linked_(x, y) & below) && (linked_(x + 1, y) & below) &&
                       (linked_(x, y + 1) & right);
      between_(x, y) = all ? 0 : not_a_number;
    }
  });
}

void TimeField::bound_blocks(const PixelSet* news) {
  const auto columns = around(news, map_->width(), map_->height(), 1);
  parallel_rows(earliest_.height(), [&](int row) {
    const int top = row * time_block_px, bottom = std::min(top + time_block_px + 1, map_->height());
    Columns new_ones;
    for (int y = top; y < bottom; ++y) {
      new_ones.begin = std::min(new_ones.begin, columns[static_cast<std::size_t>(y)].begin);
      new_ones.end = std::max(new_ones.end, columns[static_cast<std::size_t>(y)].end);
    }
    for (int column = new_ones.begin / time_block_px; column < blocks_over(new_ones.end); ++column) {
      const int left = column * time_block_px, width = std::min(time_block_px + 1, map_->width() - left);
      float earliest = infinity, latest = -infinity;
      for (int y = top; y < bottom; ++y)
        for (const float time :
             map_->time.row(y).subspan(static_cast<std::size_t>(left), static_cast<std::size_t>(width))) {
          earliest = time < earliest ? time : earliest;  // passes over NaN
          latest = time > latest ? time : latest;
        }
      earliest_(column, row) = earliest;
      latest_(column, row) = latest;
    }
  });
  parallel_rows(earliest_.height(), [&](int row) {
    const int top = std::max(0, row - 1), bottom = std::min(row + 2, earliest_.height());
    for (int column = 0; column < earliest_.width(); ++column) {
      const int left = std::max(0, column - 1), right = std::min(column + 2, earliest_.width());
      float earliest = infinity, latest = -infinity;
      for (int y = top; y < bottom; ++y)
        for (int x = left; x < right; ++x) {
          earliest = std::min(earliest, earliest_(x, y));
          latest = std::max(latest, latest_(x, y));
        }
      earliest_around_(column, row) = earliest;
      latest_around_(column, row) = latest;
    }
  });
}

TimeArrays TimeField::arrays() const {
  return {map_->time.data(), map_->sigma.data(),      map_->amplitude.data(), between_.data(),  map_->width(),
          map_->height(),    earliest_around_.data(), latest_around_.data(),  earliest_.width()};
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
