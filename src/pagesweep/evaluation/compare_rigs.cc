// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/evaluation/compare_rigs.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace pagesweep {
namespace {

/// The point with the least sum of squared distances to rays.
Eigen::Vector3d meet(const std::vector<Ray>& rays) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const Ray& ray : rays) {
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - ray.direction * ray.direction.transpose();
    normal += across;
    right += across * ray.origin;
  }
  return normal.ldlt().solve(right);
}

/// True points, and what the rig makes of the true cameras' pixels.
struct Pairs {
  std::vector<Eigen::Vector3d> truth, measured;
};

/// Adds a point if two cameras see it.
void add_point(const Rig& rig, const Rig& truth, const Eigen::Vector3d& point, Pairs& pairs) {
  std::vector<Ray> rays;
  for (const Camera& camera : truth.cameras) {
    const auto pixel = camera.project(point);
    if (!pixel || !camera.sees(*pixel)) continue;
    if (const auto ray = rig.find_camera(camera.name)->ray(*pixel)) rays.push_back(*ray);
  }
  if (rays.size() < 2) return;
  pairs.truth.push_back(point);
  pairs.measured.push_back(meet(rays));
}

Pairs sample(const Rig& rig, const Rig& truth, const RigComparisonOptions& options) {
  constexpr double reach_mm = 600;  // of the table around the origin
  Pairs pairs;
  for (double z = options.lowest_mm; z <= options.highest_mm; z += options.grid_mm)
    for (double y = -reach_mm; y <= reach_mm; y += options.grid_mm)
      for (double x = -reach_mm; x <= reach_mm; x += options.grid_mm) add_point(rig, truth, {x, y, z}, pairs);
  return pairs;
}

Rigid3 best_motion(const Pairs& pairs) {
  Eigen::Matrix3Xd from(3, Eigen::Index(pairs.truth.size())), to = from;
  for (Eigen::Index k = 0; k < from.cols(); ++k) {
    from.col(k) = pairs.measured[std::size_t(k)];
    to.col(k) = pairs.truth[std::size_t(k)];
  }
  const Eigen::Matrix4d motion = Eigen::umeyama(from, to, false);
  return {motion.topLeftCorner<3, 3>(), motion.topRightCorner<3, 1>()};
}

void require_comparable(const Rig& rig, const Rig& truth, const RigComparisonOptions& options) {
  if (!(options.grid_mm > 0 && options.highest_mm >= options.lowest_mm))
    throw std::invalid_argument("the volume's --lowest, --highest and --grid must make a volume");
  for (const Camera& camera : truth.cameras)
    if (!rig.find_camera(camera.name))
      throw std::invalid_argument(fmt::format("the rig has no camera '{}', as the true one has", camera.name));
}

void compare_scans(const Scanner& scanner, const Scanner& truth, const Pairs& pairs, const Rigid3& truth_from_rig,
                   RigComparison& result) {
  const Rigid3 rig_from_truth = truth_from_rig.inverse();
  double squares = 0;
  for (const Eigen::Vector3d& point : pairs.truth) {
    const auto expected = truth.project(point), found = scanner.project(rig_from_truth * point);
    if (!expected || !found || !truth.sees(*expected)) continue;
    const double error = (*found - *expected).norm();
    squares += error * error;
    result.scan_worst_px = std::max(result.scan_worst_px, error);
    ++result.scan_points;
  }
  if (result.scan_points > 0) result.scan_rms_px = std::sqrt(squares / double(result.scan_points));
}

}  // namespace

RigComparison compare_rigs(const Rig& rig, const Rig& truth, const RigComparisonOptions& options) {
  require_comparable(rig, truth, options);
  const Pairs pairs = sample(rig, truth, options);
  if (pairs.truth.size() < 4) throw std::invalid_argument("no two cameras see the volume that rigs are compared in");
  const Rigid3 truth_from_rig = best_motion(pairs);
  RigComparison result{.points = pairs.truth.size()};
  double squares = 0;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (std::size_t k = 0; k < pairs.truth.size(); ++k) {
    const double error = (truth_from_rig * pairs.measured[k] - pairs.truth[k]).norm();
    squares += error * error;
    result.point_worst_mm = std::max(result.point_worst_mm, error);
    middle += pairs.measured[k] / double(pairs.truth.size());
  }
  result.point_rms_mm = std::sqrt(squares / double(result.points));
  result.frame_turn_rad = Eigen::AngleAxisd(truth_from_rig.rotation).angle();
  result.frame_shift_mm = (truth_from_rig * middle - middle).norm();
  if (rig.scanner && truth.scanner) compare_scans(*rig.scanner, *truth.scanner, pairs, truth_from_rig, result);
  return result;
}

std::vector<Figure> figures_of(const RigComparison& c) {
  std::vector<Figure> figures{
      {"rig", "points", "points in the volume", double(c.points), "", ""},
      {"rig", "point_rms", "error of triangulated points, rms", c.point_rms_mm, "mm", ""},
      {"rig", "point_worst", "error of triangulated points, worst", c.point_worst_mm, "mm", ""},
      {"rig", "frame_turn", "angle between the frames", c.frame_turn_rad, "rad", ""},
      {"rig", "frame_shift", "distance of the frames at the volume's middle", c.frame_shift_mm, "mm", ""}};
  if (c.scan_points > 0) {
    figures.push_back({"rig", "scan_rms", "error of positions in the scan, rms", c.scan_rms_px, "px", ""});
    figures.push_back({"rig", "scan_worst", "error of positions in the scan, worst", c.scan_worst_px, "px", ""});
  }
  return figures;
}

}  // namespace pagesweep
