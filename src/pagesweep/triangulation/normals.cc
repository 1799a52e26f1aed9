// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/triangulation/normals.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "pagesweep/base/local_plane.h"
#include "pagesweep/base/parallel.h"

namespace pagesweep {
namespace {

constexpr int rows_at_once = 8;

/// The normal of a plane seen around pixel (x, y), in the camera's frame and towards it.
/// \param plane  its inverse depth, over that of the pixel's own point, less 1
Eigen::Vector3f normal_of(const LocalPlane& plane, const RayTable& rays, int x, int y) {
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

/// Of the rows within `reach` pixels of the set.
Image<float> inverse_depths(const PointMap& points, const Camera& camera, const PixelSet* only, int reach) {
  std::vector<std::uint8_t> takes_part(static_cast<std::size_t>(points.height()), only == nullptr);
  for (int y = 0; only && y < points.height(); ++y)
    if (any_takes_part(only, y))
      for (int i = std::max(0, y - reach); i <= std::min(y + reach, points.height() - 1); ++i)
        takes_part[static_cast<std::size_t>(i)] = 1;
  Image<float> inverse_depth(points.width(), points.height(), not_a_number);
  const Eigen::Vector3d axis = camera.cam_from_rig.rotation.row(2);
  const double offset = camera.cam_from_rig.translation.z();
  parallel_rows(points.height(), [&](int y) {
    if (!takes_part[static_cast<std::size_t>(y)]) return;
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

void fit_normals(PointMap& points, const RayTable& camera, int radius_px, const PixelSet* only) {
  const Image<float> inverse_depth = inverse_depths(points, camera.camera(), only, radius_px);
  const Eigen::Matrix3f rig_from_cam = camera.camera().cam_from_rig.rotation.transpose().cast<float>();
  const auto put = [&](const PlaneBatch& planes, std::size_t k) {
    const int x = planes.column[k], y = planes.row;
    if (!planes.found(k)) {
      if (planes.size[k] < 7) reject(points, x, y);
      return;
    }
    const LocalPlane plane = planes.plane(k);
    const float here = inverse_depth(x, y);
    const float sigma = points.sigma(x, y) * here * here;  // of an inverse depth
    if (std::abs(plane.middle) > 6 * std::max(sigma, planes.median[k])) return reject(points, x, y);
    const LocalPlane relative{plane.across / here, plane.down / here, plane.middle / here};
    const Eigen::Vector3f normal = rig_from_cam * normal_of(relative, camera, x, y);
    points.nx(x, y) = normal.x();
    points.ny(x, y) = normal.y();
    points.nz(x, y) = normal.z();
  };
  parallel_ranges(points.height(), rows_at_once, [&](int begin, int end) {
    PlaneFitter fitter(radius_px);
    for (int y = begin; y < end; ++y) {
      if (!any_takes_part(only, y)) continue;
      const auto is_wanted = [&](int x) { return points.status(x, y) == PixelStatus::ok && takes_part(only, x, y); };
      in_batches(points.width(), y, is_wanted, [&](PlaneBatch& planes) {
        fitter.fit(inverse_depth, planes);
        for (std::size_t k = 0; k < planes.count; ++k) put(planes, k);
      });
    }
  });
}

}  // namespace pagesweep
