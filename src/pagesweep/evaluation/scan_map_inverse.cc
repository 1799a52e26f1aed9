// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/evaluation/scan_map_inverse.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

namespace pagesweep {
namespace {

constexpr int node_step_px = 12;  // of the page: pages bend on a scale of many millimetres, this is one at 300 dpi

Eigen::Vector2d at(const ScanMap& map, int x, int y) { return {map.u(x, y), map.v(x, y)}; }

/// The map's bilinear cell that contains a page position, and the position within it.
struct Cell {
  Eigen::Vector2d corner[2][2];  ///< [row][column] scan positions
  double a = 0, b = 0;           ///< right and down, 0 to 1 inside the cell

  Eigen::Vector2d value() const {
    return (1 - b) * ((1 - a) * corner[0][0] + a * corner[0][1]) + b * ((1 - a) * corner[1][0] + a * corner[1][1]);
  }
  Eigen::Matrix2d jacobian() const {
    Eigen::Matrix2d j;
    j.col(0) = (1 - b) * (corner[0][1] - corner[0][0]) + b * (corner[1][1] - corner[1][0]);
    j.col(1) = (1 - a) * (corner[1][0] - corner[0][0]) + a * (corner[1][1] - corner[0][1]);
    return j;
  }
};

std::optional<Cell> cell_at(const ScanMap& map, const Eigen::Vector2d& pixel) {
  const bool is_inside =
      pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() <= map.width() - 1 && pixel.y() <= map.height() - 1;
  if (!is_inside || map.width() < 2 || map.height() < 2) return std::nullopt;
  const int x = std::min(static_cast<int>(pixel.x()), map.width() - 2);
  const int y = std::min(static_cast<int>(pixel.y()), map.height() - 2);
  Cell cell{
      {{at(map, x, y), at(map, x + 1, y)}, {at(map, x, y + 1), at(map, x + 1, y + 1)}}, pixel.x() - x, pixel.y() - y};
  for (const auto& row : cell.corner)
    for (const Eigen::Vector2d& corner : row)
      if (!corner.allFinite()) return std::nullopt;
  return cell;
}

}  // namespace

std::optional<Eigen::Vector2d> scan_position(const ScanMap& map, const Eigen::Vector2d& pixel) {
  const auto cell = cell_at(map, pixel);
  if (!cell) return std::nullopt;
  return cell->value();
}

ScanMapInverse::ScanMapInverse(const ScanMap& map) : map_(map) {
  std::vector<Node> nodes;
  Eigen::Vector2d high = Eigen::Vector2d::Constant(-std::numeric_limits<double>::infinity());
  low_ = -high;
  for (int y = 0; y < map.height(); y += node_step_px)
    for (int x = 0; x < map.width(); x += node_step_px) {
      const Eigen::Vector2d scan = at(map, x, y);
      if (!scan.allFinite()) continue;
      nodes.push_back({scan.cast<float>(), Eigen::Vector2f(x, y)});
      low_ = low_.cwiseMin(scan);
      high = high.cwiseMax(scan);
    }
  if (nodes.empty()) return;
  // About two nodes a bucket, so that the buckets around a place hold its neighbours; never more than a million
  // buckets, whatever stray values a file may hold.
  const Eigen::Vector2d size = (high - low_).cwiseMax(1);
  cell_px_ = std::max({1.0, std::sqrt(2 * size.prod() / static_cast<double>(nodes.size())), size.maxCoeff() / 1000});
  columns_ = static_cast<int>(size.x() / cell_px_) + 1;
  rows_ = static_cast<int>(size.y() / cell_px_) + 1;
  buckets_.resize(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_));
  for (const Node& node : nodes) {
    const Eigen::Vector2d place = (node.scan.cast<double>() - low_) / cell_px_;
    const auto column = static_cast<std::size_t>(std::clamp(static_cast<int>(place.x()), 0, columns_ - 1));
    const auto row = static_cast<std::size_t>(std::clamp(static_cast<int>(place.y()), 0, rows_ - 1));
    buckets_[row * static_cast<std::size_t>(columns_) + column].push_back(node);
  }
}

const std::vector<ScanMapInverse::Node>* ScanMapInverse::bucket(int column, int row) const {
  if (column < 0 || row < 0 || column >= columns_ || row >= rows_) return nullptr;
  return &buckets_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
                   static_cast<std::size_t>(column)];
}

std::optional<Eigen::Vector2d> ScanMapInverse::operator()(const Eigen::Vector2d& scan) const {
  if (buckets_.empty() || !scan.allFinite()) return std::nullopt;
  const Eigen::Vector2d place = (scan - low_) / cell_px_;
  if (!(place.cwiseAbs().maxCoeff() < 1e6)) return std::nullopt;
  const int column = static_cast<int>(std::floor(place.x())), row = static_cast<int>(std::floor(place.y()));
  std::vector<std::pair<float, Eigen::Vector2f>> starts;
  for (int j = row - 2; j <= row + 2; ++j)
    for (int i = column - 2; i <= column + 2; ++i)
      if (const auto* nodes = bucket(i, j))
        for (const Node& node : *nodes) starts.emplace_back((node.scan - scan.cast<float>()).squaredNorm(), node.page);
  // More than one start: on a page with hidden parts the way from the nearest one may lead through a hole.
  const std::size_t tries = std::min<std::size_t>(4, starts.size());
  std::partial_sort(starts.begin(), starts.begin() + static_cast<std::ptrdiff_t>(tries), starts.end(),
                    [](const auto& a, const auto& b) { return a.first < b.first; });
  for (std::size_t i = 0; i < tries; ++i)
    if (const auto page = refine(scan, starts[i].second.cast<double>())) return page;
  return std::nullopt;
}

std::optional<Eigen::Vector2d> ScanMapInverse::refine(const Eigen::Vector2d& scan, Eigen::Vector2d page) const {
  constexpr double exact_px = 1e-3;
  const Eigen::Vector2d last(map_.width() - 1, map_.height() - 1);
  Eigen::Matrix2d jacobian = Eigen::Matrix2d::Zero();
  for (int step = 0; step < 30; ++step) {
    const auto cell = cell_at(map_, page);
    if (!cell) return std::nullopt;
    const Eigen::Vector2d miss = scan - cell->value();
    if (miss.norm() < exact_px) return page;
    jacobian = cell->jacobian();
    if (std::abs(jacobian.determinant()) < 1e-9) return std::nullopt;
    Eigen::Vector2d move = jacobian.inverse() * miss;
    constexpr double longest_px = 2.0 * node_step_px;
    if (move.norm() > longest_px) move *= longest_px / move.norm();
    page = (page + move).cwiseMax(0).cwiseMin(last);
  }
  return std::nullopt;
}

}  // namespace pagesweep
