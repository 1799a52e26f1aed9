// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <vector>

#include "pagesweep/base/parallel.h"
#include "pagesweep/report/pictures.h"

namespace pagesweep {
namespace {

/// Extent of the plan in the rig's xy plane, without the outermost stray points.
struct Plan {
  Range x, y;
  std::size_t points = 0;
  double mean_nz = 0;
};

Plan plan_of(std::span<const PointMap* const> cameras) {
  std::vector<float> xs, ys;
  Plan plan;
  for (const PointMap* map : cameras)
    for (std::size_t i = 0; i < map->status.size(); ++i) {
      if (map->status.data()[i] != PixelStatus::ok) continue;
      xs.push_back(map->x.data()[i]);
      ys.push_back(map->y.data()[i]);
      if (std::isfinite(map->nz.data()[i])) plan.mean_nz += map->nz.data()[i];
    }
  plan.points = xs.size();
  if (xs.empty()) return plan;
  const auto extent = [](std::vector<float>& values) -> Range {
    const auto at = [&](double share) -> double {
      const auto place = values.begin() + std::lround(share * static_cast<double>(values.size() - 1));
      std::nth_element(values.begin(), place, values.end());
      return *place;
    };
    const double low = at(0.002), high = at(0.998), border = 0.01 * (high - low);
    return {low - border, high + border};
  };
  plan.x = extent(xs);
  plan.y = extent(ys);
  return plan;
}

/// Empty cells with at least five full neighbours take their mean.
Image<float> fill_small_holes(const Image<float>& height) {
  Image<float> filled = height;
  parallel_rows(height.height(), [&](int y) {
    for (int x = 0; x < height.width(); ++x) {
      if (std::isfinite(height(x, y))) continue;
      double sum = 0;
      int count = 0;
      for (int j = y - 1; j <= y + 1; ++j)
        for (int i = x - 1; i <= x + 1; ++i)
          if (height.contains(i, j) && std::isfinite(height(i, j))) {
            sum += height(i, j);
            ++count;
          }
      if (count >= 5) filled(x, y) = static_cast<float>(sum / count);
    }
  });
  return filled;
}

/// Mean over the full cells of a square of 2 radius + 1 cells, where the middle is full; rows first, then columns.
Image<float> smooth(const Image<float>& height, int radius) {
  const auto pass = [&](const Image<float>& from, int dx, int dy) {
    Image<float> to = from;
    parallel_rows(from.height(), [&](int y) {
      for (int x = 0; x < from.width(); ++x) {
        if (!std::isfinite(from(x, y))) continue;
        double sum = 0;
        int count = 0;
        for (int k = -radius; k <= radius; ++k) {
          const int i = x + k * dx, j = y + k * dy;
          if (!from.contains(i, j) || !std::isfinite(from(i, j))) continue;
          sum += from(i, j);
          ++count;
        }
        to(x, y) = static_cast<float>(sum / count);
      }
    });
    return to;
  };
  return pass(pass(height, 1, 0), 0, 1);
}

}  // namespace

HeightField make_height_field(std::span<const PointMap> cameras, int longest_px) {
  std::vector<const PointMap*> pointers;
  for (const PointMap& map : cameras) pointers.push_back(&map);
  return make_height_field(pointers, longest_px);
}

HeightField make_height_field(std::span<const PointMap* const> cameras, int longest_px) {
  const Plan plan = plan_of(cameras);
  const double width_mm = plan.x.high - plan.x.low, depth_mm = plan.y.high - plan.y.low;
  HeightField field;
  if (plan.points == 0 || !(width_mm > 0 && depth_mm > 0)) return field;
  field.z_is_towards = plan.mean_nz >= 0;
  // About one point a cell and camera at the finest.
  const double point_mm =
      std::sqrt(width_mm * depth_mm * static_cast<double>(cameras.size()) / static_cast<double>(plan.points));
  field.mm_per_px = std::max(std::max(width_mm, depth_mm) / longest_px, point_mm);
  const int columns = std::max(1, static_cast<int>(width_mm / field.mm_per_px));
  const int rows = std::max(1, static_cast<int>(depth_mm / field.mm_per_px));
  const double up = field.z_is_towards ? 1 : -1;
  Image<double> sums(columns, rows);
  Image<int> counts(columns, rows);
  for (const PointMap* map : cameras)
    for (std::size_t i = 0; i < map->status.size(); ++i) {
      if (map->status.data()[i] != PixelStatus::ok) continue;
      const double x = (map->x.data()[i] - plan.x.low) / field.mm_per_px;
      const double from_top = up > 0 ? plan.y.high - map->y.data()[i] : map->y.data()[i] - plan.y.low;
      const double y = from_top / field.mm_per_px;
      if (!(x >= 0 && y >= 0 && x < columns && y < rows)) continue;
      sums(static_cast<int>(x), static_cast<int>(y)) += up * map->z.data()[i];
      ++counts(static_cast<int>(x), static_cast<int>(y));
    }
  field.height = Image<float>(columns, rows, not_a_number);
  for (std::size_t i = 0; i < sums.size(); ++i)
    if (counts.data()[i] > 0) field.height.data()[i] = static_cast<float>(sums.data()[i] / counts.data()[i]);
  field.height = fill_small_holes(fill_small_holes(field.height));
  return field;
}

Picture draw_relief(const HeightField& field, Range height_mm) {
  const Image<float> height = smooth(field.height, 2);
  const Eigen::Vector3d light = Eigen::Vector3d(-1, 1, 1.6).normalized();  // x right, y up the picture, z to the viewer
  Picture picture = draw_map(height, Ramp::sequential, height_mm);
  auto& bytes = std::get<Image<std::uint8_t>>(picture.samples);
  const auto rise = [&](int x0, int y0, int x1, int y1) -> double {
    const bool known = height.contains(x0, y0) && height.contains(x1, y1);
    const double d = known ? height(x1, y1) - height(x0, y0) : not_a_number;
    return std::isfinite(d) ? d / (field.mm_per_px * (std::abs(x1 - x0) + std::abs(y1 - y0))) : 0;
  };
  constexpr double ambient = 0.35, exaggeration = 2;
  const double level = light.z();
  parallel_rows(height.height(), [&](int y) {
    for (int x = 0; x < height.width(); ++x) {
      if (!std::isfinite(height(x, y))) continue;
      const Eigen::Vector3d normal =
          Eigen::Vector3d(-exaggeration * rise(x - 1, y, x + 1, y), -exaggeration * rise(x, y + 1, x, y - 1), 1)
              .normalized();
      // A level surface keeps the colour of its height, so that the colour bar is true there.
      const double shade = ambient + (1 - ambient) * std::max(0.0, normal.dot(light)) / level;
      for (int c = 0; c < 3; ++c) {
        std::uint8_t& sample = bytes(3 * x + c, y);
        sample = static_cast<std::uint8_t>(std::clamp(std::lround(sample * shade), 0l, 255l));
      }
    }
  });
  return picture;
}

}  // namespace pagesweep
