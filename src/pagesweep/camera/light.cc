// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/camera/light.h"

#include <Eigen/Geometry>
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

}  // namespace pagesweep
