// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/sim/lamp.h"

#include <Eigen/Geometry>
#include <cmath>
#include <stdexcept>

namespace pagesweep::sim {

Lamp::Lamp(Light light, double height_mm, double length_mm)
    : light_(std::move(light)), height_mm_(height_mm), length_mm_(length_mm) {
  if (const auto* plane = std::get_if<TranslatingPlane>(&light_.model())) {
    along_ = plane->normal.cross(Eigen::Vector3d::UnitZ()).normalized();
    const double level = plane->normal.head<2>().norm();
    table_distance_mm_ = height_mm_ / level;
    table_speed_mm_ = std::abs(plane->offset_per_frame);
  } else {
    const auto& turning = std::get<RotatingPlane>(light_.model());
    along_ = turning.axis;
    height_mm_ = table_distance_mm_ = turning.axis_point.z();
    table_speed_mm_ = std::abs(turning.angle_per_frame) * table_distance_mm_;
  }
}

Eigen::Vector3d Lamp::middle_at(double time_frames) const {
  if (const auto* turning = std::get_if<RotatingPlane>(&light_.model())) return turning->axis_point;
  const Plane plane = light_.plane_at(time_frames);
  // The point of the plane at the bar's height that is nearest to the sweep's line x = 0.
  const Eigen::Vector3d above(0, 0, height_mm_);
  const double y = (plane.offset - plane.normal.dot(above)) / plane.normal.y();
  return above + Eigen::Vector3d(0, y, 0);
}

double Lamp::time_of(const Eigen::Vector3d& point) const {
  const auto time = light_.time_of(point);
  if (!time) throw std::invalid_argument("the light never passes a point of the scene");
  return *time;
}

double Lamp::speed_at(const Eigen::Vector3d& point) const {
  if (std::holds_alternative<RotatingPlane>(light_.model())) return table_speed_mm_;
  const Eigen::Vector3d offset = point - middle_at(time_of(point));
  return table_speed_mm_ * table_distance_mm_ / offset.cross(along_).norm();
}

}  // namespace pagesweep::sim
