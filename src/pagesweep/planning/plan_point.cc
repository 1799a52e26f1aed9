// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/planning/plan_point.h"

#include <cmath>

namespace pagesweep {

bool sees_level(const Camera& camera, const Eigen::Vector3d& spot) {
  const auto picture = camera.project(spot);
  return picture && camera.sees(*picture) && camera.center().z() > spot.z();
}

double time_slope(const Light& light, const Eigen::Vector3d& spot, const Eigen::Vector3d& step) {
  // The time is a rational function or an arc tangent of the place: over 0.02 mm the central difference is exact to
  // 1e-9.
  constexpr double h = 0.01;
  const auto before = light.time_of(spot - h * step), after = light.time_of(spot + h * step);
  return before && after ? (*after - *before) / (2 * h) : SpotAccuracy::missing;
}

SpotAccuracy plan_point(const Camera& from, const Camera* to, const Light& light, double time_sigma,
                        const Eigen::Vector3d& spot) {
  SpotAccuracy accuracy;
  if (!sees_level(from, spot)) return accuracy;
  const Eigen::Vector3d ray = (spot - from.center()).normalized();
  accuracy.height_share = std::abs(ray.z());
  const double lit_slope = time_slope(light, spot, ray);  // T'
  accuracy.section_mm = time_sigma / std::abs(lit_slope);
  if (!to || !sees_level(*to, spot)) return accuracy;

  // Where the other camera sees the point that slides along the ray, it sees paper that slides as well.
  const Eigen::Vector3d other_ray = (spot - to->center()).normalized();
  const Eigen::Vector3d paper_step = ray - other_ray * (ray.z() / other_ray.z());
  const double seen_slope = time_slope(light, spot, paper_step);  // S
  const double first = time_sigma * time_sigma, second = interpolated_variance * first;
  accuracy.stereo_mm = std::sqrt(first + second) / std::abs(seen_slope);
  accuracy.match_px = accuracy.stereo_mm * (to->project_jacobian(spot) * ray).norm();
  accuracy.joint_mm = 1 / std::sqrt(lit_slope * lit_slope / first + std::pow(seen_slope - lit_slope, 2) / second);
  return accuracy;
}

}  // namespace pagesweep
