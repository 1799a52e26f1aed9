// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/camera/camera.h"

#include <Eigen/LU>
#include <cmath>

namespace pagesweep {

Eigen::Vector2d BrownConrady::distort(const Eigen::Vector2d& ideal) const {
  const double x = ideal.x(), y = ideal.y();
  const double r2 = x * x + y * y;
  const double radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
  return {x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x), y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y};
}

Eigen::Matrix2d BrownConrady::jacobian(const Eigen::Vector2d& ideal) const {
  const double x = ideal.x(), y = ideal.y();
  const double r2 = x * x + y * y;
  const double radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
  const double slope = 2 * (k1 + r2 * (2 * k2 + r2 * 3 * k3));  // d radial / d r2, times 2
  Eigen::Matrix2d j;
  j << radial + x * x * slope + 2 * p1 * y + 6 * p2 * x, x * y * slope + 2 * p1 * x + 2 * p2 * y,
      x * y * slope + 2 * p1 * x + 2 * p2 * y, radial + y * y * slope + 6 * p1 * y + 2 * p2 * x;
  return j;
}

bool BrownConrady::is_valid_at(double radius_squared) const {
  // d/dr of r (1 + k1 q + k2 q^2 + k3 q^3), q = r^2, is the cubic below; it must be positive on all of [0, q]: at the
  // far end and at those of its own extrema that lie between.
  const double least =
      1 - radius_squared * (3 * std::abs(k1) + radius_squared * (5 * std::abs(k2) + radius_squared * 7 * std::abs(k3)));
  if (least > 0) return true;  // whatever the signs: the usual case
  const auto slope = [&](double q) { return 1 + q * (3 * k1 + q * (5 * k2 + q * 7 * k3)); };
  if (!(slope(radius_squared) > 0)) return false;
  const auto holds_at = [&](double q) { return !(q > 0 && q < radius_squared) || slope(q) > 0; };
  const double a = 21 * k3, b = 10 * k2, c = 3 * k1;  // derivative of slope: a q^2 + b q + c
  if (a == 0) return b == 0 || holds_at(-c / b);
  const double discriminant = b * b - 4 * a * c;
  if (discriminant < 0) return true;
  const double root = std::sqrt(discriminant);
  return holds_at((-b - root) / (2 * a)) && holds_at((-b + root) / (2 * a));
}

std::optional<Eigen::Vector2d> BrownConrady::undistort(const Eigen::Vector2d& distorted) const {
  Eigen::Vector2d ideal = distorted;
  for (int i = 0; i < 30; ++i) {
    const Eigen::Vector2d error = distort(ideal) - distorted;
    const Eigen::Matrix2d j = jacobian(ideal);
    if (!(std::abs(j.determinant()) > 1e-6)) return std::nullopt;
    const Eigen::Vector2d step = j.inverse() * error;
    ideal -= step;
    if (!(ideal.squaredNorm() < 16)) return std::nullopt;
    if (step.squaredNorm() < 1e-28) break;
  }
  const bool found = (distort(ideal) - distorted).norm() < 1e-12 && is_valid_at(ideal.squaredNorm());
  return found ? std::optional(ideal) : std::nullopt;
}

std::optional<Eigen::Vector2d> Camera::project(const Eigen::Vector3d& rig_point) const {
  const Eigen::Vector3d p = cam_from_rig * rig_point;
  if (!(p.z() > 0)) return std::nullopt;
  const Eigen::Vector2d ideal = p.head<2>() / p.z();
  if (!distortion.is_valid_at(ideal.squaredNorm())) return std::nullopt;
  const Eigen::Vector2d image = distortion.distort(ideal);
  return Eigen::Vector2d(fx * image.x() + cx, fy * image.y() + cy);
}

Matrix23d Camera::project_jacobian(const Eigen::Vector3d& rig_point) const {
  const Eigen::Vector3d p = cam_from_rig * rig_point;
  const Eigen::Vector2d ideal = p.head<2>() / p.z();
  Matrix23d ideal_by_point;
  ideal_by_point << 1 / p.z(), 0, -ideal.x() / p.z(), 0, 1 / p.z(), -ideal.y() / p.z();
  return Eigen::Vector2d(fx, fy).asDiagonal() * distortion.jacobian(ideal) * ideal_by_point * cam_from_rig.rotation;
}

std::optional<Ray> Camera::ray(const Eigen::Vector2d& pixel) const {
  const auto ideal = distortion.undistort({(pixel.x() - cx) / fx, (pixel.y() - cy) / fy});
  if (!ideal) return std::nullopt;
  const Eigen::Vector3d direction = cam_from_rig.rotation.transpose() * Eigen::Vector3d(ideal->x(), ideal->y(), 1);
  return Ray{center(), direction.normalized()};
}

}  // namespace pagesweep
