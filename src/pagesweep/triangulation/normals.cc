// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/triangulation/normals.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "pagesweep/base/parallel.h"

namespace pagesweep {
namespace {

/// A neighbour: its direction from the middle pixel's, and its inverse depth over the middle pixel's, less 1.
struct Sample {
  float dx, dy, depth;
};

/// depth = m . (dx, dy, 1) by least squares over the samples that miss `first` by at most `limit`.
std::optional<Eigen::Vector3f> fit_plane(const std::vector<Sample>& samples, const Eigen::Vector3f& first,
                                         float limit) {
  Eigen::Matrix3f normal_matrix = Eigen::Matrix3f::Zero();
  Eigen::Vector3f right = Eigen::Vector3f::Zero();
  int count = 0;
  float xx = 0, xy = 0, yy = 0, x = 0, y = 0, xd = 0, yd = 0, d = 0;
  for (const Sample& s : samples) {
    const float use = std::abs(s.depth - (first.x() * s.dx + first.y() * s.dy + first.z())) <= limit ? 1.0f : 0.0f;
    count += static_cast<int>(use);
    xx += use * s.dx * s.dx;
    xy += use * s.dx * s.dy;
    yy += use * s.dy * s.dy;
    x += use * s.dx;
    y += use * s.dy;
    xd += use * s.dx * s.depth;
    yd += use * s.dy * s.depth;
    d += use * s.depth;
  }
  if (count < 6) return std::nullopt;
  normal_matrix << xx, xy, x, xy, yy, y, x, y, static_cast<float>(count);
  right << xd, yd, d;
  const Eigen::LDLT<Eigen::Matrix3f> solver(normal_matrix);
  const Eigen::Vector3f pivots = solver.vectorD();
  if (!(pivots.minCoeff() > 1e-4f)) return std::nullopt;  // [px^2] the samples lie on a line
  return solver.solve(right);
}

/// The neighbours of one pixel that have a point; directions in pixels, so that the fit is well scaled.
class Neighbourhood {
 public:
  Neighbourhood(const Image<float>& inverse_depth, const Camera& camera, const RayTable& rays, int radius)
      : inverse_depth_(inverse_depth), rays_(rays), focal_px_(camera.fx), radius_(radius) {}

  /// Normal in the camera's frame.
  std::optional<Eigen::Vector3d> normal_at(int x, int y) {
    gather(x, y);
    auto plane = fit_plane(samples_, Eigen::Vector3f::Zero(), std::numeric_limits<float>::infinity());
    if (!plane) return std::nullopt;
    misses_.clear();
    for (const Sample& s : samples_)
      misses_.push_back(std::abs(s.depth - (plane->x() * s.dx + plane->y() * s.dy + plane->z())));
    const auto middle = misses_.begin() + static_cast<std::ptrdiff_t>(misses_.size() / 2);
    std::nth_element(misses_.begin(), middle, misses_.end());
    const float median = *middle;
    const bool outliers = std::any_of(middle, misses_.end(), [&](float miss) { return miss > 3 * median; });
    if (outliers) plane = fit_plane(samples_, *plane, 3 * median);
    if (!plane) return std::nullopt;
    // depth = mx dx + my dy + mz with (dx, dy) = f (direction - here): back to m . (X/Z, Y/Z, 1) = 1/Z.
    const Eigen::Vector2d here = rays_.direction(x, y);
    const Eigen::Vector2d slope = focal_px_ * plane->head<2>().cast<double>();
    const Eigen::Vector3d m(slope.x(), slope.y(), 1 + plane->z() - slope.dot(here));
    return Eigen::Vector3d(-m.normalized());
  }

 private:
  void gather(int x, int y) {
    samples_.clear();
    const float here = inverse_depth_(x, y);
    const Eigen::Vector2d direction = rays_.direction(x, y);
    const int top = std::max(0, y - radius_), bottom = std::min(inverse_depth_.height() - 1, y + radius_);
    const int left = std::max(0, x - radius_), right = std::min(inverse_depth_.width() - 1, x + radius_);
    for (int row = top; row <= bottom; ++row)
      for (int column = left; column <= right; ++column) {
        const float depth = inverse_depth_(column, row);
        if (std::isnan(depth)) continue;
        const Eigen::Vector2f offset = (focal_px_ * (rays_.direction(column, row) - direction)).cast<float>();
        samples_.push_back({offset.x(), offset.y(), depth / here - 1});
      }
  }

  const Image<float>& inverse_depth_;
  const RayTable& rays_;
  double focal_px_;
  int radius_;
  std::vector<Sample> samples_;
  std::vector<float> misses_;
};

}  // namespace

void estimate_normals(PointMap& points, const Camera& camera, const RayTable& rays, int radius_px) {
  Image<float> inverse_depth(points.width(), points.height(), not_a_number);
  const Eigen::Vector3f axis = camera.cam_from_rig.rotation.row(2).cast<float>();
  const auto offset = static_cast<float>(camera.cam_from_rig.translation.z());
  parallel_rows(points.height(), [&](int y) {
    for (int x = 0; x < points.width(); ++x)
      if (points.status(x, y) == PixelStatus::ok)
        inverse_depth(x, y) = 1 / (axis.dot(Eigen::Vector3f(points.x(x, y), points.y(x, y), points.z(x, y))) + offset);
  });
  const Eigen::Matrix3d rig_from_cam = camera.cam_from_rig.rotation.transpose();
  parallel_rows(points.height(), [&](int y) {
    Neighbourhood neighbourhood(inverse_depth, camera, rays, radius_px);
    for (int x = 0; x < points.width(); ++x) {
      if (points.status(x, y) != PixelStatus::ok) continue;
      const auto normal = neighbourhood.normal_at(x, y);
      if (!normal) continue;
      const Eigen::Vector3f in_rig = (rig_from_cam * *normal).cast<float>();
      points.nx(x, y) = in_rig.x();
      points.ny(x, y) = in_rig.y();
      points.nz(x, y) = in_rig.z();
    }
  });
}

}  // namespace pagesweep
