// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/triangulation/normals.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "pagesweep/base/parallel.h"

namespace pagesweep {
namespace {

/// A plane as one camera sees it around a pixel: relative inverse depth = across i + down j + middle, at i columns to
/// the right and j rows down.
struct SeenPlane {
  float across = 0, down = 0, middle = 0;
  float at(float i, float j) const { return across * i + down * j + middle; }
};

/// The points around one pixel.
class Neighbourhood {
 public:
  /// Of pixel (x, y), the middle one included; inverse depths are taken over the middle one's, less 1.
  void gather(const Image<float>& inverse_depth, int x, int y, int radius) {
    i_.clear();
    j_.clear();
    depth_.clear();
    const float scale = 1 / inverse_depth(x, y);
    const int top = std::max(0, y - radius), bottom = std::min(inverse_depth.height() - 1, y + radius);
    const int left = std::max(0, x - radius), right = std::min(inverse_depth.width() - 1, x + radius);
    for (int row = top; row <= bottom; ++row)
      for (int column = left; column <= right; ++column) {
        const float depth = inverse_depth(column, row);
        if (std::isnan(depth)) continue;
        i_.push_back(static_cast<float>(column - x));
        j_.push_back(static_cast<float>(row - y));
        depth_.push_back(depth * scale - 1);
      }
  }

  std::size_t size() const { return depth_.size(); }

  /// Least squares over the points that miss `before` by at most `limit`; nothing if they are few or on a line.
  std::optional<SeenPlane> fit(const SeenPlane& before, float limit) const;

  /// Median of the distances from a plane, and whether any of them is more than three times as much.
  std::pair<float, bool> median_miss(const SeenPlane& plane) {
    misses_.clear();
    for (std::size_t k = 0; k < size(); ++k) misses_.push_back(std::abs(depth_[k] - plane.at(i_[k], j_[k])));
    const auto middle = misses_.begin() + static_cast<std::ptrdiff_t>(misses_.size() / 2);
    std::nth_element(misses_.begin(), middle, misses_.end());
    return {*middle, *std::max_element(middle, misses_.end()) > 3 * *middle};
  }

 private:
  std::vector<float> i_, j_, depth_, misses_;
};

std::optional<SeenPlane> Neighbourhood::fit(const SeenPlane& before, float limit) const {
  float n = 0, i = 0, j = 0, ii = 0, ij = 0, jj = 0, d = 0, id = 0, jd = 0;
  for (std::size_t k = 0; k < size(); ++k) {
    const float use = std::abs(depth_[k] - before.at(i_[k], j_[k])) <= limit ? 1.0f : 0.0f;
    const float ui = use * i_[k], uj = use * j_[k];
    n += use;
    i += ui;
    j += uj;
    ii += ui * i_[k];
    ij += ui * j_[k];
    jj += uj * j_[k];
    d += use * depth_[k];
    id += ui * depth_[k];
    jd += uj * depth_[k];
  }
  if (n < 6) return std::nullopt;
  // About the centroid, the two slopes are a 2 x 2 system.
  const float cii = ii - i * i / n, cij = ij - i * j / n, cjj = jj - j * j / n;
  const float cid = id - i * d / n, cjd = jd - j * d / n;
  const float determinant = cii * cjj - cij * cij;
  if (!(determinant > 1e-3f * n * n)) return std::nullopt;
  const float across = (cid * cjj - cjd * cij) / determinant, down = (cjd * cii - cid * cij) / determinant;
  return SeenPlane{across, down, (d - across * i - down * j) / n};
}

/// The normal of a plane seen around pixel (x, y), in the camera's frame and towards it.
Eigen::Vector3f normal_of(const SeenPlane& plane, const RayTable& rays, int x, int y) {
  const int right = std::min(x + 1, rays.width() - 1), left = std::max(x - 1, 0);
  const int bottom = std::min(y + 1, rays.height() - 1), top = std::max(y - 1, 0);
  Eigen::Matrix2d direction_by_pixel;
  direction_by_pixel << (rays.direction(right, y) - rays.direction(left, y)) / (right - left),
      (rays.direction(x, bottom) - rays.direction(x, top)) / (bottom - top);
  // Slopes by pixel are slopes by direction times that matrix.
  const Eigen::Vector2d slope = direction_by_pixel.transpose().inverse() * Eigen::Vector2d(plane.across, plane.down);
  const double here = 1 + plane.middle - slope.dot(rays.direction(x, y));
  return -Eigen::Vector3d(slope.x(), slope.y(), here).normalized().cast<float>();
}

Image<float> inverse_depths(const PointMap& points, const Camera& camera) {
  Image<float> inverse_depth(points.width(), points.height(), not_a_number);
  const Eigen::Vector3d axis = camera.cam_from_rig.rotation.row(2);
  const double offset = camera.cam_from_rig.translation.z();
  parallel_rows(points.height(), [&](int y) {
    for (int x = 0; x < points.width(); ++x) {
      if (points.status(x, y) != PixelStatus::ok) continue;
      const Eigen::Vector3d point(points.x(x, y), points.y(x, y), points.z(x, y));
      inverse_depth(x, y) = static_cast<float>(1 / (axis.dot(point) + offset));
    }
  });
  return inverse_depth;
}

void reject(PointMap& points, int x, int y) {
  points.x(x, y) = points.y(x, y) = points.z(x, y) = points.sigma(x, y) = not_a_number;
  points.status(x, y) = PixelStatus::off_surface;
}

}  // namespace

void fit_normals(PointMap& points, const Camera& camera, const RayTable& rays, int radius_px) {
  const Image<float> inverse_depth = inverse_depths(points, camera);
  const Eigen::Matrix3f rig_from_cam = camera.cam_from_rig.rotation.transpose().cast<float>();
  constexpr float everything = std::numeric_limits<float>::infinity();
  parallel_rows(points.height(), [&](int y) {
    Neighbourhood around;
    for (int x = 0; x < points.width(); ++x) {
      if (points.status(x, y) != PixelStatus::ok) continue;
      around.gather(inverse_depth, x, y, radius_px);
      auto plane = around.fit({}, everything);
      if (!plane) {
        if (around.size() < 7) reject(points, x, y);
        continue;
      }
      const auto [median, has_outliers] = around.median_miss(*plane);
      if (has_outliers) plane = around.fit(*plane, 3 * median);
      if (!plane) continue;
      const float relative_sigma = points.sigma(x, y) * inverse_depth(x, y);
      if (std::abs(plane->middle) > 6 * std::max(relative_sigma, median)) {
        reject(points, x, y);
        continue;
      }
      const Eigen::Vector3f normal = rig_from_cam * normal_of(*plane, rays, x, y);
      points.nx(x, y) = normal.x();
      points.ny(x, y) = normal.y();
      points.nz(x, y) = normal.z();
    }
  });
}

}  // namespace pagesweep
