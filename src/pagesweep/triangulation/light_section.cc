// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/triangulation/light_section.h"

#include <algorithm>
#include <cmath>
#include <variant>

namespace pagesweep {
namespace {

double distance_to_light(const Light& light, const Ray& ray, double time_frames) {
  const Plane plane = light.plane_at(time_frames);
  return -plane.distance(ray.origin) / plane.normal.dot(ray.direction);
}

}  // namespace

LightSection section(const Light& light, const Ray& ray, double time_frames) {
  // The distance is a rational function of the time that changes little in a frame, so the central difference over
  // 0.02 frames is exact to 1e-6 of itself.
  constexpr double h = 0.01;
  return {distance_to_light(light, ray, time_frames),
          (distance_to_light(light, ray, time_frames + h) - distance_to_light(light, ray, time_frames - h)) / (2 * h)};
}

SeenLight::SeenLight(const Light& light, const Eigen::Vector3d& center)
    : light_(light), center_(center), recorded_(std::get_if<RecordedPlanes>(&light.model())) {
  if (!recorded_) return;
  for (const Plane& plane : recorded_->planes) from_center_mm_.push_back(plane.distance(center));
}

LightSection SeenLight::section(const Eigen::Vector3d& direction, double time_frames) const {
  if (!recorded_) return pagesweep::section(light_, {center_, direction}, time_frames);
  const double place = time_frames - recorded_->first_frame;
  const double before = std::clamp(std::floor(place), 0.0, static_cast<double>(recorded_->planes.size() - 2));
  const auto k = static_cast<std::size_t>(before);
  const double part = place - before;
  // Distance to the plane and its slope along the ray run evenly from one frame to the next.
  const double far0 = from_center_mm_[k], far1 = from_center_mm_[k + 1];
  const double slope0 = recorded_->planes[k].normal.dot(direction),
               slope1 = recorded_->planes[k + 1].normal.dot(direction);
  const double slope = slope0 + part * (slope1 - slope0), inverse = 1 / slope;
  return {-(far0 + part * (far1 - far0)) * inverse, (far0 * slope1 - far1 * slope0) * inverse * inverse};
}

std::optional<double> SeenLight::time_of(const Eigen::Vector3d& rig_point, double expected) const {
  const double place = recorded_ ? expected - recorded_->first_frame : -1;
  if (place >= 0 && place < static_cast<double>(recorded_->planes.size() - 1)) {
    const auto k = static_cast<std::size_t>(place);
    const double before = recorded_->planes[k].distance(rig_point),
                 behind = recorded_->planes[k + 1].distance(rig_point);
    // A point is passed once, so this is where.
    if ((before > 0) != (behind > 0))
      return recorded_->first_frame + static_cast<double>(k) - before / (behind - before);
  }
  return light_.time_of(rig_point);
}

}  // namespace pagesweep
