// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/camera/light.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace pagesweep {
namespace {

Plane plane_of(const TranslatingPlane& light, double time) {
  return {light.normal, light.offset + time * light.offset_per_frame};
}

Plane plane_of(const RotatingPlane& light, double time) {
  const double angle = light.angle0 + time * light.angle_per_frame;
  const Eigen::Vector3d normal = Eigen::AngleAxisd(angle, light.axis) * light.normal0;
  return {normal, normal.dot(light.axis_point)};
}

std::optional<double> passing_time(const TranslatingPlane& light, const Eigen::Vector3d& point) {
  if (light.offset_per_frame == 0) return std::nullopt;
  return (light.normal.dot(point) - light.offset) / light.offset_per_frame;
}

/// The plane, a sheet with two wings, contains the point at two angles a turn of pi apart; the stripe's own is the one
/// within a quarter turn of normal0's plane.
std::optional<double> passing_time(const RotatingPlane& light, const Eigen::Vector3d& point) {
  const Eigen::Vector3d arm = point - light.axis_point;
  const double along_normal = light.normal0.dot(arm);
  const double along_plane = light.axis.cross(light.normal0).dot(arm);
  if (light.angle_per_frame == 0 || (along_normal == 0 && along_plane == 0)) return std::nullopt;
  // normal(a) . arm = cos(a) along_normal + sin(a) along_plane = 0
  const double angle = std::atan2(-along_normal, along_plane);
  const double half_turn = 3.14159265358979323846;
  const double principal = angle - half_turn * std::round(angle / half_turn);
  return (principal - light.angle0) / light.angle_per_frame;
}

Plane plane_of(const RecordedPlanes& light, double time) {
  const double place = time - light.first_frame;
  const auto last = static_cast<double>(light.planes.size() - 2);
  const double before = std::clamp(std::floor(place), 0.0, last);
  const double part = place - before;
  const Plane &a = light.planes[static_cast<std::size_t>(before)],
              &b = light.planes[static_cast<std::size_t>(before) + 1];
  const Eigen::Vector3d normal = (1 - part) * a.normal + part * b.normal;
  const double length = normal.norm();
  return {normal / length, ((1 - part) * a.offset + part * b.offset) / length};
}

/// Of the intervals between frames, the one at whose ends the point lies on different sides of the plane; an outermost
/// one if there is none.
std::optional<double> passing_time(const RecordedPlanes& light, const Eigen::Vector3d& point) {
  const auto distance = [&](std::size_t k) { return light.planes[k].distance(point); };
  std::size_t low = 0, high = light.planes.size() - 1;
  const bool rises = distance(high) > distance(low);
  while (high - low > 1) {
    const std::size_t middle = (low + high) / 2;
    ((distance(middle) > 0) == rises ? high : low) = middle;
  }
  const double at_low = distance(low), step = distance(high) - at_low;
  if (step == 0) return std::nullopt;
  return light.first_frame + static_cast<double>(low) - at_low / step;
}

TranslatingPlane sped_up(TranslatingPlane light, double factor) {
  light.offset_per_frame *= factor;
  return light;
}

RotatingPlane sped_up(RotatingPlane light, double factor) {
  light.angle_per_frame *= factor;
  return light;
}

RecordedPlanes sped_up(const RecordedPlanes& light, double factor) {
  const double last = light.first_frame + static_cast<double>(light.planes.size() - 1);
  RecordedPlanes faster{static_cast<int>(std::floor(light.first_frame / factor)), {}};
  const int frames = std::max(2, static_cast<int>(std::ceil(last / factor)) - faster.first_frame + 1);
  for (int i = 0; i < frames; ++i) faster.planes.push_back(plane_of(light, (faster.first_frame + i) * factor));
  return faster;
}

}  // namespace

std::optional<Eigen::Vector3d> Plane::meet(const Ray& ray) const {
  const double slope = normal.dot(ray.direction);
  const double along = -distance(ray.origin) / slope;
  if (!(std::isfinite(along) && along > 0)) return std::nullopt;
  return ray.at(along);
}

Plane Light::plane_at(double time_frames) const {
  return std::visit([&](const auto& light) { return plane_of(light, time_frames); }, model_);
}

std::optional<double> Light::time_of(const Eigen::Vector3d& rig_point) const {
  return std::visit([&](const auto& light) { return passing_time(light, rig_point); }, model_);
}

Light Light::sped_up(double factor) const {
  return std::visit([&](const auto& light) { return Light(pagesweep::sped_up(light, factor)); }, model_);
}

}  // namespace pagesweep
