// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <random>
#include <vector>

#include "pagesweep/acceptance/seen_points.h"
#include "pagesweep/io/artefact_file.h"
#include "pagesweep/sim/analytic_scene.h"

namespace pagesweep::test {

/// A plate of 120 mm x 80 mm and spheres on a table, measured with noise along the viewing rays.
struct ArtefactScene {
  Eigen::Vector3d plate_middle{-10, 60, 40};
  Eigen::Vector2d plate_slope{0.1, -0.2};  ///< dz/dx, dz/dy
  double plate_turn_rad = 0.2;
  std::vector<Eigen::Vector3d> centers{{-75, -50, 25}, {75, -50, 25}};
  double radius_mm = 20;
  double sigma_mm = 0.05;

  double height(double x, double y) const {
    double z = 0;
    const Eigen::Vector2d place =
        Eigen::Rotation2Dd(-plate_turn_rad) * Eigen::Vector2d(x - plate_middle.x(), y - plate_middle.y());
    // The plate's shadow on the xy plane; shorter than the plate by the cosine of its slope.
    const double shrink = 1 / std::hypot(1.0, plate_slope.norm());
    if (std::abs(place.x()) <= 60 * shrink && std::abs(place.y()) <= 40 * shrink)
      z = plate_middle.z() + plate_slope.x() * (x - plate_middle.x()) + plate_slope.y() * (y - plate_middle.y());
    for (const Eigen::Vector3d& center : centers) {
      const double squared = radius_mm * radius_mm - (Eigen::Vector2d(x, y) - center.head<2>()).squaredNorm();
      if (squared > 0) z = std::max(z, center.z() + std::sqrt(squared));
    }
    return z;
  }

  ArtefactPose measure(unsigned seed = 1) const {
    const sim::AnalyticScene scene{[this](double x, double y) { return height(x, y); }, 100, -20};
    std::mt19937 random(seed);
    std::normal_distribution<double> noise(0, sigma_mm);
    ArtefactPose pose{"pose", sim::make_test_rig().cameras, {}};
    for (const Camera& camera : pose.cameras) {
      PointMap map = scene.points(camera, sigma_mm);
      for (std::size_t i = 0; i < map.x.size(); ++i) {
        if (map.status.data()[i] != PixelStatus::ok) continue;
        const Eigen::Vector3d point(map.x.data()[i], map.y.data()[i], map.z.data()[i]);
        const Eigen::Vector3d moved = point + noise(random) * (point - camera.center()).normalized();
        map.x.data()[i] = static_cast<float>(moved.x());
        map.y.data()[i] = static_cast<float>(moved.y());
        map.z.data()[i] = static_cast<float>(moved.z());
      }
      pose.points.push_back(std::move(map));
    }
    return pose;
  }

  Artefact artefact() const {
    Artefact artefact{"test", Eigen::Vector2d(120, 80), {}, {}};
    artefact.sphere_diameters_mm.assign(centers.size(), 2 * radius_mm);
    if (centers.size() == 2) artefact.spacing_mm = (centers[1] - centers[0]).norm();
    return artefact;
  }
};

}  // namespace pagesweep::test
