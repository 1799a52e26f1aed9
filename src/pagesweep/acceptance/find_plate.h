// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <span>

#include "pagesweep/acceptance/seen_points.h"
#include "pagesweep/camera/light.h"

namespace pagesweep {

/// A flat rectangle in space.
struct Plate {
  Plane plane;                                        ///< its normal towards the cameras
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();   ///< [mm]
  Eigen::Vector3d along = Eigen::Vector3d::UnitX();   ///< direction of the longer side, to the right
  Eigen::Vector2d size_mm = Eigen::Vector2d::Zero();  ///< longer, shorter side

  Eigen::Vector3d across() const { return plane.normal.cross(along); }
  /// Place on the plate [mm] from its middle, along the longer and the shorter side.
  Eigen::Vector2d place_of(const Eigen::Vector3d& point) const {
    return {along.dot(point - middle), across().dot(point - middle)};
  }
};

/// Finds a flat rectangle of known size among everything else, such as the table that it lies on.
///
/// One plane after the other, each with most points (RANSAC from single oriented points, refined; seeded, so that the
/// result is always the same); of each the largest connected part, and the smallest rectangle around that.
/// The first whose sides are those of the plate within a tenth is the plate.
/// \param size_mm  longer, shorter side
std::optional<Plate> find_plate(std::span<const OrientedPoint> points, const Eigen::Vector2d& size_mm);

}  // namespace pagesweep
