// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/acceptance/shapes.h"

#include <Eigen/Dense>
#include <stdexcept>

namespace pagesweep {
namespace {

constexpr int most_steps = 50;

/// Derivatives of a point's distance by centre and radius.
Eigen::Vector4d gradient(const Sphere& sphere, const Eigen::Vector3d& point) {
  Eigen::Vector4d gradient;
  gradient << -(point - sphere.center).normalized(), -1;
  return gradient;
}

}  // namespace

Plane fit_plane(std::span<const Eigen::Vector3d> points) {
  if (points.size() < 3) throw std::invalid_argument("a plane needs 3 points");
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : points) mean += point;
  mean /= static_cast<double>(points.size());
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& point : points) covariance += (point - mean) * (point - mean).transpose();
  const Eigen::Vector3d normal = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(covariance).eigenvectors().col(0);
  return {normal, normal.dot(mean)};
}

Sphere fit_sphere(std::span<const Eigen::Vector3d> points, const Sphere& start) {
  if (points.size() < 4) throw std::invalid_argument("a sphere needs 4 points");
  Sphere sphere = start;
  for (int step = 0; step < most_steps; ++step) {
    Eigen::Matrix4d normal_matrix = Eigen::Matrix4d::Zero();
    Eigen::Vector4d right = Eigen::Vector4d::Zero();
    for (const Eigen::Vector3d& point : points) {
      const Eigen::Vector4d row = gradient(sphere, point);
      normal_matrix += row * row.transpose();
      right -= row * sphere.distance(point);
    }
    const Eigen::Vector4d change = normal_matrix.ldlt().solve(right);
    sphere.center += change.head<3>();
    sphere.radius_mm += change[3];
    if (change.norm() < 1e-10 * start.radius_mm) break;
  }
  return sphere;
}

Eigen::Matrix4d covariance_of(const Sphere& sphere, std::span<const Eigen::Vector3d> points, double sigma_mm) {
  Eigen::Matrix4d normal_matrix = Eigen::Matrix4d::Zero();
  for (const Eigen::Vector3d& point : points) {
    const Eigen::Vector4d row = gradient(sphere, point);
    normal_matrix += row * row.transpose();
  }
  return sigma_mm * sigma_mm * normal_matrix.inverse();
}

}  // namespace pagesweep
