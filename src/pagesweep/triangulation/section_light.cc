// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/triangulation/section_light.h"

#include <Eigen/Geometry>
#include <cmath>
#include <optional>
#include <stdexcept>

#include "pagesweep/base/parallel.h"
#include "pagesweep/camera/ray_table.h"
#include "pagesweep/triangulation/normals.h"

namespace pagesweep {
namespace {

/// Distance along the ray [mm] at which the sheet of light of that time crosses it, in front or behind.
double distance_to_light(const Light& light, const Ray& ray, double time_frames) {
  const Plane plane = light.plane_at(time_frames);
  return -plane.distance(ray.origin) / plane.normal.dot(ray.direction);
}

/// The speed of the meeting point along the ray [mm/frame]. The distance is a rational function of the time that
/// changes little in a frame, so the central difference over 0.02 frames is exact to 1e-6 of itself.
double sliding_speed(const Light& light, const Ray& ray, double time_frames) {
  constexpr double h = 0.01;
  return (distance_to_light(light, ray, time_frames + h) - distance_to_light(light, ray, time_frames - h)) / (2 * h);
}

}  // namespace

PointMap section_light(const TimeMap& times, const Camera& camera, const Light& light,
                       const TriangulationOptions& options) {
  if (times.width() != camera.width || times.height() != camera.height)
    throw std::invalid_argument("section_light: the time map is not of the camera's size");
  const RayTable rays(camera);
  const Eigen::Vector3d center = camera.center();
  const Eigen::Matrix3d rig_from_cam = camera.cam_from_rig.rotation.transpose();
  PointMap points(camera.width, camera.height);
  points.intensity = times.amplitude;
  parallel_rows(camera.height, [&](int y) {
    for (int x = 0; x < camera.width; ++x) {
      PixelStatus& status = points.status(x, y);
      status = times.status(x, y);
      if (status != PixelStatus::ok) continue;
      const Eigen::Vector3d direction = rig_from_cam * rays.direction(x, y).homogeneous();
      const Ray ray{center, direction.normalized()};
      const double distance = distance_to_light(light, ray, times.time(x, y));
      if (!(distance > 0 && std::isfinite(distance))) {
        status = PixelStatus::rays_miss;
        continue;
      }
      const double depth = distance / direction.norm();
      if (depth < options.near_mm || (options.far_mm > 0 && depth > options.far_mm)) {
        status = PixelStatus::outside_depth;
        continue;
      }
      const Eigen::Vector3f point = ray.at(distance).cast<float>();
      points.x(x, y) = point.x();
      points.y(x, y) = point.y();
      points.z(x, y) = point.z();
      points.sigma(x, y) =
          static_cast<float>(times.sigma(x, y) * std::abs(sliding_speed(light, ray, times.time(x, y))));
    }
  });
  fit_normals(points, camera, rays, options.normal_radius_px);
  return points;
}

}  // namespace pagesweep
