// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <variant>

#include "pagesweep/camera/camera.h"

namespace pagesweep {

/// A line sensor that travels in a straight line. Row v looks from center + v step:
/// X_c = R (X_rig - center - v step); v is where Y_c = 0; x = X_c / Z_c; u = f x (1 + k1 x^2) + cx.
struct Pushbroom {
  int width = 0, height = 0;  ///< [px]
  double f = 0, cx = 0;       ///< [px]
  double k1 = 0;
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  ///< [mm]
  Eigen::Vector3d step = Eigen::Vector3d::UnitY();   ///< [mm] a row
};

/// A line sensor behind a turning mirror. Row v looks in the plane turned by a = angle0 + v angle_step about the
/// camera's x axis: X_c = Rx(a) R (X_rig - center); v is where Y_c = 0; u as for Pushbroom.
struct RotatingLine {
  int width = 0, height = 0;  ///< [px]
  double f = 0, cx = 0;       ///< [px]
  double k1 = 0;
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  ///< [mm]
  double angle0 = 0;                                 ///< [rad]
  double angle_step = 0;                             ///< [rad] a row
};

/// The scanner's own picture of the rig frame: the function G of the paper (eq. 12), in one of three models. A frame
/// camera stands also for a line sensor that travels behind a fixed lens.
class Scanner {
 public:
  using Model = std::variant<Camera, Pushbroom, RotatingLine>;
  Scanner() = default;
  Scanner(Model model) : model_(std::move(model)) {}

  const Model& model() const { return model_; }
  int width() const;   ///< [px]
  int height() const;  ///< [px]
  /// Where a rig point is imaged in the scan [px], inside it or not; nothing if it is never seen.
  std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& rig_point) const;
  /// d project / d rig_point [px/mm]. \pre project(rig_point)
  Matrix23d project_jacobian(const Eigen::Vector3d& rig_point) const;
  /// The viewing ray of a scan position, in the rig frame.
  std::optional<Ray> ray(const Eigen::Vector2d& pixel) const;
  bool sees(const Eigen::Vector2d& pixel) const {
    return pixel.x() >= -0.5 && pixel.y() >= -0.5 && pixel.x() <= width() - 0.5 && pixel.y() <= height() - 0.5;
  }

 private:
  Model model_;
};

}  // namespace pagesweep
