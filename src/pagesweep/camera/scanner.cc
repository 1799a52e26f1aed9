// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/camera/scanner.h"

#include <Eigen/Geometry>
#include <cmath>

namespace pagesweep {
namespace {

/// The image of a line sensor: u as a function of x = X_c / Z_c.
template <class Line>
double column_of(const Line& line, double x) {
  return line.f * x * (1 + line.k1 * x * x) + line.cx;
}

template <class Line>
double column_slope(const Line& line, double x) {
  return line.f * (1 + 3 * line.k1 * x * x);
}

/// Inverse of column_of() by Newton's method.
template <class Line>
std::optional<double> direction_of(const Line& line, double u) {
  double x = (u - line.cx) / line.f;
  for (int i = 0; i < 30; ++i) {
    const double step = (column_of(line, x) - u) / column_slope(line, x);
    if (!std::isfinite(step)) return std::nullopt;
    x -= step;
    if (std::abs(step) < 1e-14 * (1 + std::abs(x))) return x;
  }
  return std::nullopt;
}

Eigen::Matrix3d turn_about_x(double angle) {
  return Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitX()).toRotationMatrix();
}

std::optional<Eigen::Vector2d> project_to(const Camera& camera, const Eigen::Vector3d& point) {
  return camera.project(point);
}

double row_of(const Pushbroom& line, const Eigen::Vector3d& point) {
  const Eigen::RowVector3d across = line.rotation.row(1);
  return across.dot(point - line.center) / across.dot(line.step);
}

std::optional<Eigen::Vector2d> project_to(const Pushbroom& line, const Eigen::Vector3d& point) {
  const double v = row_of(line, point);
  const Eigen::Vector3d p = line.rotation * (point - line.center - v * line.step);
  if (!(p.z() > 0) || !std::isfinite(v)) return std::nullopt;
  return Eigen::Vector2d(column_of(line, p.x() / p.z()), v);
}

std::optional<Eigen::Vector2d> project_to(const RotatingLine& line, const Eigen::Vector3d& point) {
  const Eigen::Vector3d p = line.rotation * (point - line.center);
  const double depth = std::hypot(p.y(), p.z());
  if (!(depth > 0) || line.angle_step == 0) return std::nullopt;
  // Y_c = cos(a) p.y - sin(a) p.z = 0 with Z_c = sin(a) p.y + cos(a) p.z > 0
  const double angle = std::atan2(p.y(), p.z());
  return Eigen::Vector2d(column_of(line, p.x() / depth), (angle - line.angle0) / line.angle_step);
}

Matrix23d jacobian_of(const Camera& camera, const Eigen::Vector3d& point) { return camera.project_jacobian(point); }

Matrix23d jacobian_of(const Pushbroom& line, const Eigen::Vector3d& point) {
  const Eigen::RowVector3d across = line.rotation.row(1);
  const Eigen::RowVector3d row_by_point = across / across.dot(line.step);
  const Eigen::Vector3d p = line.rotation * (point - line.center - row_of(line, point) * line.step);
  const Eigen::Matrix3d p_by_point = line.rotation * (Eigen::Matrix3d::Identity() - line.step * row_by_point);
  const double x = p.x() / p.z();
  Matrix23d j;
  j.row(0) = column_slope(line, x) / p.z() * (p_by_point.row(0) - x * p_by_point.row(2));
  j.row(1) = row_by_point;
  return j;
}

Matrix23d jacobian_of(const RotatingLine& line, const Eigen::Vector3d& point) {
  const Eigen::Vector3d p = line.rotation * (point - line.center);
  const double depth = std::hypot(p.y(), p.z());
  const double x = p.x() / depth;
  Matrix23d by_p;
  by_p.row(0) = column_slope(line, x) / depth * Eigen::RowVector3d(1, -x * p.y() / depth, -x * p.z() / depth);
  by_p.row(1) = Eigen::RowVector3d(0, p.z(), -p.y()) / (depth * depth * line.angle_step);
  return by_p * line.rotation;
}

std::optional<Ray> ray_of(const Camera& camera, const Eigen::Vector2d& pixel) { return camera.ray(pixel); }

std::optional<Ray> ray_of(const Pushbroom& line, const Eigen::Vector2d& pixel) {
  const auto x = direction_of(line, pixel.x());
  if (!x) return std::nullopt;
  const Eigen::Vector3d direction = line.rotation.transpose() * Eigen::Vector3d(*x, 0, 1);
  return Ray{line.center + pixel.y() * line.step, direction.normalized()};
}

std::optional<Ray> ray_of(const RotatingLine& line, const Eigen::Vector2d& pixel) {
  const auto x = direction_of(line, pixel.x());
  if (!x) return std::nullopt;
  const Eigen::Matrix3d line_from_rig = turn_about_x(line.angle0 + pixel.y() * line.angle_step) * line.rotation;
  return Ray{line.center, (line_from_rig.transpose() * Eigen::Vector3d(*x, 0, 1)).normalized()};
}

}  // namespace

int Scanner::width() const {
  return std::visit([](const auto& model) { return model.width; }, model_);
}

int Scanner::height() const {
  return std::visit([](const auto& model) { return model.height; }, model_);
}

std::optional<Eigen::Vector2d> Scanner::project(const Eigen::Vector3d& rig_point) const {
  return std::visit([&](const auto& model) { return project_to(model, rig_point); }, model_);
}

Matrix23d Scanner::project_jacobian(const Eigen::Vector3d& rig_point) const {
  return std::visit([&](const auto& model) { return jacobian_of(model, rig_point); }, model_);
}

std::optional<Ray> Scanner::ray(const Eigen::Vector2d& pixel) const {
  return std::visit([&](const auto& model) { return ray_of(model, pixel); }, model_);
}

}  // namespace pagesweep
