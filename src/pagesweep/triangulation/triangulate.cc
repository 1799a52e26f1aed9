// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/triangulation/triangulate.h"

#include <Eigen/Geometry>
#include <cmath>
#include <optional>
#include <stdexcept>

#include "pagesweep/base/parallel.h"

namespace pagesweep {
namespace {

/// A point on the first of two lines, where the second passes nearest.
struct Meeting {
  double distance_mm;  ///< from the first line's origin, along its direction
  double gap_mm;       ///< between the lines
};

/// \return  nothing if the lines are parallel or do not meet in front of both origins
std::optional<Meeting> meet(const Ray& first, const Ray& second) {
  const Eigen::Vector3d baseline = second.origin - first.origin;
  const double cosine = first.direction.dot(second.direction);
  const double sine_squared = 1 - cosine * cosine;
  if (!(sine_squared > 1e-12)) return std::nullopt;
  const double along_first = first.direction.dot(baseline), along_second = second.direction.dot(baseline);
  const double s = (along_first - cosine * along_second) / sine_squared;
  const double t = (cosine * along_first - along_second) / sine_squared;
  if (!(s > 0 && t > 0)) return std::nullopt;
  return Meeting{s, (first.at(s) - second.at(t)).norm()};
}

Ray ray_towards(const Camera& camera, const Eigen::Vector3d& center, const Eigen::Vector2d& direction) {
  const Eigen::Vector3d in_rig = camera.cam_from_rig.rotation.transpose() * direction.homogeneous();
  return {center, in_rig.normalized()};
}

/// What is needed to triangulate one pixel after the other.
class Triangulator {
 public:
  Triangulator(const RayTable& from, const RayTable& to, const TriangulationOptions& options)
      : from_(from.camera()), to_(to.camera()), from_rays_(from), to_rays_(to), options_(options) {}

  void put(const Correspondences& matches, int x, int y, PointMap& points) const {
    const auto fail = [&](PixelStatus why) { points.status(x, y) = why; };
    if (matches.status(x, y) != PixelStatus::ok) return fail(matches.status(x, y));
    const Ray ray = ray_towards(from_, from_center_, from_rays_.direction(x, y));
    const Eigen::Vector2d match(matches.u(x, y), matches.v(x, y));
    const Ray other = ray_towards(to_, to_center_, to_rays_.direction_at(match));
    const auto meeting = meet(ray, other);
    if (!meeting) return fail(PixelStatus::rays_miss);
    const Eigen::Vector3d point = ray.at(meeting->distance_mm);
    const auto picture = to_.project(point);
    if (!picture) return fail(PixelStatus::rays_miss);
    // A gap of a pixel is what the other camera sees under one at the point's distance.
    const double gap_px = meeting->gap_mm * to_.fx / (point - to_center_).norm();
    if (!(gap_px <= options_.max_ray_gap_px)) return fail(PixelStatus::rays_miss);
    const double depth = (from_.cam_from_rig * point).z();
    if (depth < options_.near_mm || (options_.far_mm > 0 && depth > options_.far_mm))
      return fail(PixelStatus::outside_depth);
    const double pixels_per_mm = (to_.project_jacobian(point) * ray.direction).norm();
    points.x(x, y) = static_cast<float>(point.x());
    points.y(x, y) = static_cast<float>(point.y());
    points.z(x, y) = static_cast<float>(point.z());
    points.sigma(x, y) = static_cast<float>(matches.sigma(x, y) / pixels_per_mm);
    points.status(x, y) = PixelStatus::ok;
  }

 private:
  const Camera& from_;
  const Camera& to_;
  const RayTable& from_rays_;
  const RayTable& to_rays_;
  const TriangulationOptions& options_;
  const Eigen::Vector3d from_center_ = from_.center();
  const Eigen::Vector3d to_center_ = to_.center();
};

}  // namespace

void triangulate(const Correspondences& matches, const RayTable& from, const RayTable& to,
                 const TriangulationOptions& options, PointMap& points, const PixelSet* only) {
  const auto fits = [&](const auto& map) { return map.width() == from.width() && map.height() == from.height(); };
  if (!fits(matches) || !fits(points))
    throw std::invalid_argument("triangulate: matches or points are not of the camera's size");
  const Triangulator triangulator(from, to, options);
  parallel_rows(from.height(), [&](int y) {
    for (int x = 0; x < from.width(); ++x)
      if (takes_part(only, x, y)) triangulator.put(matches, x, y, points);
  });
}

PointMap triangulate(const Correspondences& matches, const Image<float>& intensity, const RayTable& from,
                     const RayTable& to, const TriangulationOptions& options) {
  if (!intensity.empty() && (intensity.width() != from.width() || intensity.height() != from.height()))
    throw std::invalid_argument("triangulate: the intensity is not of the camera's size");
  PointMap points(from.width(), from.height());
  triangulate(matches, from, to, options, points, nullptr);
  if (!intensity.empty()) points.intensity = intensity;
  return points;
}

}  // namespace pagesweep
