// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/time_field.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include "pagesweep/base/parallel.h"

namespace pagesweep {
namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();

int blocks_over(int pixels) { return (pixels + time_block_px - 1) / time_block_px; }

/// Of two numbers; of what is only one, that.
float lesser(float a, float b) {
  const float lower = a < b ? a : b;
  return b != b ? a : lower;
}
float greater(float a, float b) {
  const float higher = a > b ? a : b;
  return b != b ? a : higher;
}

/// Six pixels in a line, for many x side by side: their times, and the sigmas of the middle two.
struct SixPixels {
  std::array<const float*, 6> time;
  std::array<const float*, 2> sigma;
};

/// 0 where the middle two are of one surface, NaN where not.
void link(const SixPixels& pixels, int begin, int end, float* linked) {
  const auto [a, b, c, d, e, f] = pixels.time;
  const auto [sigma_c, sigma_d] = pixels.sigma;
  for (int x = begin; x < end; ++x) {
    const float difference = std::abs(d[x] - c[x]);
    // A jump that the lens smears over two pixels has a steep neighbour on one side at most two pairs away, so each
    // side's flatter one of two pairs speaks for it. Missing pairs say nothing.
    const float before = lesser(std::abs(c[x] - b[x]), std::abs(b[x] - a[x]));
    const float behind = lesser(std::abs(e[x] - d[x]), std::abs(f[x] - e[x]));
    const float around = greater(before, behind);
    const float noise = std::sqrt(sigma_c[x] * sigma_c[x] + sigma_d[x] * sigma_d[x]);
    const float most = difference <= 3 * around ? 3 * around : 3 * around + 6 * noise;
    const float allowed = around != around ? infinity : most;
    linked[x] = difference <= allowed ? 0 : not_a_number;  // a difference of NaN never is
  }
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

/// Links of a map's pixels to those on the right and below, row by row. It holds scratch memory: one a thread.
class RowLinks {
 public:
  explicit RowLinks(const TimeMap& map)
      : map_(map),
        nowhere_(static_cast<std::size_t>(map.width()), not_a_number),
        row_(static_cast<std::size_t>(map.width() + 2 * padding), not_a_number),
        sigma_(static_cast<std::size_t>(map.width() + 1), not_a_number),
        right_(nowhere_.size()),
        below_(nowhere_.size()),
        right_below_(nowhere_.size()) {}

  /// 0 where the four pixels from (x, y) to (x + 1, y + 1) are linked, NaN where not.
  void join(int y, int begin, int end, float* between) {
    find_right(y, begin, end, right_);
    find_right(y + 1, begin, end, right_below_);
    find_below(y, begin, end + 1);
    const float *right = right_.data(), *below = below_.data(), *right_below = right_below_.data();
    for (int x = begin; x < end; ++x) between[x] = right[x] + right_below[x] + below[x] + below[x + 1];
  }

 private:
  static constexpr int padding = 3;

  void find_right(int y, int begin, int end, std::vector<float>& linked) {
    std::ranges::copy(map_.time.row(y), row_.begin() + padding);
    std::ranges::copy(map_.sigma.row(y), sigma_.begin());
    SixPixels pixels{{}, {sigma_.data(), sigma_.data() + 1}};
    for (int k = 0; k < 6; ++k) pixels.time[static_cast<std::size_t>(k)] = row_.data() + padding + k - 2;
    link(pixels, begin, end, linked.data());
  }
  void find_below(int y, int begin, int end) {
    const auto row_of = [&](const Image<float>& values, int row) {
      return row >= 0 && row < values.height() ? values.row(row).data() : nowhere_.data();
    };
    SixPixels pixels{{}, {row_of(map_.sigma, y), row_of(map_.sigma, y + 1)}};
    for (int k = 0; k < 6; ++k) pixels.time[static_cast<std::size_t>(k)] = row_of(map_.time, y + k - 2);
    link(pixels, begin, end, below_.data());
  }

  const TimeMap& map_;
  std::vector<float> nowhere_, row_, sigma_;
  std::vector<float> right_, below_, right_below_;
};

constexpr int rows_at_once = 16;

}  // namespace

TimeField::TimeField(int width, int height)
    : earliest_(blocks_over(width), blocks_over(height), infinity),
      latest_(blocks_over(width), blocks_over(height), -infinity),
      earliest_around_(earliest_),
      latest_around_(latest_),
      between_(width, height, not_a_number) {}

TimeField::TimeField(const TimeMap& map) : TimeField(map.width(), map.height()) { update(map, nullptr); }

void TimeField::update(const TimeMap& map, const PixelSet* news) {
  map_ = &map;
  constexpr int reach = 4;  // [px] from a pixel whose links, or those beside it, depend on another
  bound_blocks(news);
  const auto to_join = around(news, map.width(), map.height(), reach);
  parallel_ranges(std::max(0, map.height() - 1), rows_at_once, [&](int begin, int end) {
    RowLinks links(map);
    for (int y = begin; y < end; ++y) {
      const Columns& columns = to_join[static_cast<std::size_t>(y)];
      const int last = std::min(columns.end, map.width() - 1);
      if (columns.begin < last) links.join(y, columns.begin, last, between_.row(y).data());
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
