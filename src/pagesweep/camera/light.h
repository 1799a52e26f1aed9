// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <variant>
#include <vector>

#include "pagesweep/camera/rigid3.h"

namespace pagesweep {

/// The plane of points X with normal . X = offset.
struct Plane {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitY();  ///< unit length
  double offset = 0;                                  ///< [mm]

  double distance(const Eigen::Vector3d& point) const { return normal.dot(point) - offset; }  ///< [mm] signed
  /// Where the ray meets the plane in front of its origin; nothing if it never does.
  std::optional<Eigen::Vector3d> meet(const Ray& ray) const;
};

/// The stripe's middle at frame i: normal . X = offset + i offset_per_frame.
struct TranslatingPlane {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitY();
  double offset = 0;            ///< [mm]
  double offset_per_frame = 0;  ///< [mm]
};

/// The stripe's middle at frame i: the plane through axis_point whose normal is normal0 turned by
/// angle0 + i angle_per_frame about axis.
struct RotatingPlane {
  Eigen::Vector3d axis_point = Eigen::Vector3d::Zero();  ///< [mm]
  Eigen::Vector3d axis = Eigen::Vector3d::UnitX();       ///< unit length
  Eigen::Vector3d normal0 = Eigen::Vector3d::UnitY();    ///< unit length, perpendicular to axis
  double angle0 = 0;                                     ///< [rad]
  double angle_per_frame = 0;                            ///< [rad]
};

/// The stripe's middle, frame by frame, as a motor happened to move it: planes[k] at frame first_frame + k. Between two
/// frames, and beyond the outermost two, distance to the plane runs evenly with time.
struct RecordedPlanes {
  int first_frame = 0;
  std::vector<Plane> planes;  ///< at least two; a point in the stripe's reach is passed once
};

/// The moving sheet of light.
class Light {
 public:
  using Model = std::variant<TranslatingPlane, RotatingPlane, RecordedPlanes>;
  Light() = default;
  Light(Model model) : model_(std::move(model)) {}

  const Model& model() const { return model_; }
  /// The stripe's middle plane at a time.
  Plane plane_at(double time_frames) const;
  /// The time [frames] at which the stripe's middle passes a point; nothing if it never does.
  std::optional<double> time_of(const Eigen::Vector3d& rig_point) const;
  /// The same light as it is seen when it moves `factor` times as far from one frame to the next; frame 0 stays.
  Light sped_up(double factor) const;

 private:
  Model model_;
};

}  // namespace pagesweep
