// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/acceptance/seen_points.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>

#include "pagesweep/base/parallel.h"

namespace pagesweep {
namespace {

constexpr int fewest_neighbours = 6;

Eigen::Vector3d position(const PointMap& map, int x, int y) { return {map.x(x, y), map.y(x, y), map.z(x, y)}; }

/// Half a patch in pixels, from the median distance of neighbouring points.
int patch_radius_px(const PointMap& map, double patch_mm) {
  std::vector<double> spacings;
  for (int y = 0; y < map.height(); y += 4)
    for (int x = 0; x + 1 < map.width(); x += 4)
      if (map.status(x, y) == PixelStatus::ok && map.status(x + 1, y) == PixelStatus::ok)
        spacings.push_back((position(map, x + 1, y) - position(map, x, y)).norm());
  if (spacings.empty()) return 1;
  const auto middle = spacings.begin() + static_cast<std::ptrdiff_t>(spacings.size() / 2);
  std::nth_element(spacings.begin(), middle, spacings.end());
  return static_cast<int>(std::clamp(patch_mm / std::max(*middle, 1e-6), 1.0, 8.0) + 0.5);
}

std::optional<OrientedPoint> fit_patch(const PointMap& map, int x, int y, int radius_px, double patch_mm,
                                       const Eigen::Vector3d& eye) {
  if (map.status(x, y) != PixelStatus::ok) return std::nullopt;
  const Eigen::Vector3d middle = position(map, x, y);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
  int count = 0;
  for (int v = std::max(0, y - radius_px); v <= std::min(map.height() - 1, y + radius_px); ++v)
    for (int u = std::max(0, x - radius_px); u <= std::min(map.width() - 1, x + radius_px); ++u) {
      if (map.status(u, v) != PixelStatus::ok) continue;
      const Eigen::Vector3d offset = position(map, u, v) - middle;
      if (!(offset.squaredNorm() < 4 * patch_mm * patch_mm)) continue;  // another surface behind an edge
      sum += offset;
      squares += offset * offset.transpose();
      ++count;
    }
  if (count < fewest_neighbours) return std::nullopt;
  const Eigen::Matrix3d covariance = squares / count - sum * sum.transpose() / (double(count) * count);
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  solver.computeDirect(covariance);
  const Eigen::Vector3d normal = solver.eigenvectors().col(0);
  return OrientedPoint{middle + sum / count, normal.dot(eye - middle) < 0 ? -normal : normal};
}

}  // namespace

std::vector<SeenPoint> seen_points_of(const ArtefactPose& pose) {
  if (pose.cameras.size() != pose.points.size()) throw std::invalid_argument("expected one map of points a camera");
  std::vector<SeenPoint> points;
  for (std::size_t c = 0; c < pose.cameras.size(); ++c) {
    const Eigen::Vector3d eye = pose.cameras[c].center();
    const PointMap& map = pose.points[c];
    for (int y = 0; y < map.height(); ++y)
      for (int x = 0; x < map.width(); ++x)
        if (map.status(x, y) == PixelStatus::ok) points.push_back({position(map, x, y), eye, double(map.sigma(x, y))});
  }
  return points;
}

std::vector<OrientedPoint> oriented_points_of(const ArtefactPose& pose, double patch_mm, int most_points) {
  std::vector<OrientedPoint> points;
  for (std::size_t c = 0; c < pose.cameras.size(); ++c) {
    const PointMap& map = pose.points[c];
    const Eigen::Vector3d eye = pose.cameras[c].center();
    const int radius_px = patch_radius_px(map, patch_mm);
    const int step = std::max(1, static_cast<int>(std::sqrt(double(map.width()) * map.height() / most_points)));
    std::vector<std::vector<OrientedPoint>> rows(static_cast<std::size_t>((map.height() + step - 1) / step));
    parallel_rows(static_cast<int>(rows.size()), [&](int row) {
      for (int x = 0; x < map.width(); x += step)
        if (const auto point = fit_patch(map, x, row * step, radius_px, patch_mm, eye))
          rows[static_cast<std::size_t>(row)].push_back(*point);
    });
    for (const auto& row : rows) points.insert(points.end(), row.begin(), row.end());
  }
  return points;
}

}  // namespace pagesweep
