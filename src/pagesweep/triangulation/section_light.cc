// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/triangulation/section_light.h"

#include <Eigen/Geometry>
#include <cmath>
#include <stdexcept>

#include "pagesweep/base/parallel.h"
#include "pagesweep/triangulation/light_section.h"

namespace pagesweep {
PointMap section_light(const TimeMap& times, const RayTable& rays, const Light& light,
                       const TriangulationOptions& options) {
  const Camera& camera = rays.camera();
  if (times.width() != camera.width || times.height() != camera.height)
    throw std::invalid_argument("section_light: the time map is not of the camera's size");
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
      const LightSection met = section(light, ray, times.time(x, y));
      if (!(met.distance_mm > 0 && std::isfinite(met.distance_mm))) {
        status = PixelStatus::rays_miss;
        continue;
      }
      const double depth = met.distance_mm / direction.norm();
      if (depth < options.near_mm || (options.far_mm > 0 && depth > options.far_mm)) {
        status = PixelStatus::outside_depth;
        continue;
      }
      const Eigen::Vector3f point = ray.at(met.distance_mm).cast<float>();
      points.x(x, y) = point.x();
      points.y(x, y) = point.y();
      points.z(x, y) = point.z();
      points.sigma(x, y) = static_cast<float>(times.sigma(x, y) * std::abs(met.mm_per_frame));
    }
  });
  return points;
}

}  // namespace pagesweep
