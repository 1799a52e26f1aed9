// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/sim/obstacle.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "pagesweep/base/parallel.h"

namespace pagesweep::sim {
namespace {

constexpr double finger_rise_rad = 0.2;
constexpr double finger_press = 0.95;  // height of the axis above the paper at the end, in radii

/// The page around one of its spots: directions along and across an obstacle's, and up.
struct Ground {
  Ground(const Obstacle& obstacle, const GridMesh& page) {
    const MeshSpot spot = page.spot_at(obstacle.s_mm, obstacle.t_mm);
    place = page.point(spot);
    up = page.normal(spot).cast<double>().normalized();
    const double h = 1;
    const Eigen::Vector3d ahead = page.point(
        page.spot_at(obstacle.s_mm + h * std::cos(obstacle.turn_rad), obstacle.t_mm + h * std::sin(obstacle.turn_rad)));
    along = ahead - place;
    along = (along - along.dot(up) * up).normalized();
    across = along.cross(up);
  }
  Eigen::Vector3d place, along, across, up;
};

GridMesh make_finger(const Obstacle& obstacle, const GridMesh& page, double spacing_mm) {
  using std::numbers::pi;
  const Ground ground(obstacle, page);
  const double radius = 0.5 * obstacle.breadth_mm, cap = 0.5 * pi * radius;
  const Eigen::Vector3d axis = std::cos(finger_rise_rad) * ground.along + std::sin(finger_rise_rad) * ground.up;
  const Eigen::Vector3d above = std::cos(finger_rise_rad) * ground.up - std::sin(finger_rise_rad) * ground.along;
  const Eigen::Vector3d end = ground.place + radius * ground.along + finger_press * radius * ground.up;
  GridMesh mesh(even_lines(2 * pi * radius, spacing_mm), even_lines(cap + obstacle.length_mm - radius, spacing_mm));
  for (int j = 0; j < mesh.rows(); ++j)
    for (int i = 0; i < mesh.columns(); ++i) {
      const double around = mesh.s[std::size_t(i)] / radius, t = mesh.t[std::size_t(j)];
      const double latitude = std::min(t / radius, 0.5 * pi);  // of the round end; 0 at its tip
      const Eigen::Vector3d outward =
          std::sin(latitude) * (std::cos(around) * above + std::sin(around) * ground.across) -
          std::cos(latitude) * axis;
      mesh.positions(i, j) = end + radius * outward + std::max(0.0, t - cap) * axis;
      mesh.normals(i, j) = outward.cast<float>();
    }
  return mesh;
}

GridMesh make_slip(const Obstacle& obstacle, const GridMesh& page, double spacing_mm) {
  GridMesh mesh(even_lines(obstacle.length_mm, spacing_mm), even_lines(obstacle.breadth_mm, spacing_mm));
  const Eigen::Rotation2Dd turn(obstacle.turn_rad);
  const auto at = [&](double x, double y) -> Eigen::Vector3d {
    const Eigen::Vector2d spot = Eigen::Vector2d(obstacle.s_mm, obstacle.t_mm) +
                                 turn * Eigen::Vector2d(x - 0.5 * obstacle.length_mm, y - 0.5 * obstacle.breadth_mm);
    const MeshSpot below = page.spot_at(spot.x(), spot.y());
    const double off_middle = 2 * x / obstacle.length_mm - 1;
    return page.point(below) +
           obstacle.lift_mm * (1 + off_middle * off_middle) * page.normal(below).cast<double>().normalized();
  };
  parallel_rows(mesh.rows(), [&](int j) {
    for (int i = 0; i < mesh.columns(); ++i) {
      const double x = mesh.s[std::size_t(i)], y = mesh.t[std::size_t(j)], h = 0.5;
      mesh.positions(i, j) = at(x, y);
      mesh.normals(i, j) = (at(x, y + h) - at(x, y - h)).cross(at(x + h, y) - at(x - h, y)).normalized().cast<float>();
    }
  });
  return mesh;
}

}  // namespace

GridMesh make_obstacle(const Obstacle& obstacle, const GridMesh& page, double spacing_mm) {
  return obstacle.kind == ObstacleKind::finger ? make_finger(obstacle, page, spacing_mm)
                                               : make_slip(obstacle, page, spacing_mm);
}

}  // namespace pagesweep::sim
