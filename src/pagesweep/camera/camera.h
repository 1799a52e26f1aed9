// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>

#include "pagesweep/camera/rigid3.h"

namespace pagesweep {

/// Brown-Conrady lens distortion (Brown 1971) in OpenCV's parameter order, on normalised image coordinates:
///     x' = x (1 + k1 r2 + k2 r2^2 + k3 r2^3) + 2 p1 x y + p2 (r2 + 2 x^2),  r2 = x^2 + y^2
///     y' = y (1 + k1 r2 + k2 r2^2 + k3 r2^3) + p1 (r2 + 2 y^2) + 2 p2 x y
struct BrownConrady {
  double k1 = 0, k2 = 0, p1 = 0, p2 = 0, k3 = 0;

  Eigen::Vector2d distort(const Eigen::Vector2d& ideal) const;
  /// d distort / d ideal
  Eigen::Matrix2d jacobian(const Eigen::Vector2d& ideal) const;
  /// Inverse of distort() by Newton's method, to 1e-14; nothing where it has none within the valid radius.
  std::optional<Eigen::Vector2d> undistort(const Eigen::Vector2d& distorted) const;
  /// Whether r (1 + k1 r2 + ...) grows all the way from the centre to this radius, so that a direction out to there has
  /// one image and the model means something.
  bool is_valid_at(double radius_squared) const;
};

/// What turns light into gray values, as measured after EMVA 1288 (Standard for Characterization of Image Sensors and
/// Cameras, release 4.0). At g gray values above black, noise has the variance gain g + read_noise^2.
struct CameraSensor {
  double gain = 1;          ///< system gain [gray values an electron], from photon transfer
  double read_noise = 0;    ///< temporal noise in the dark [gray values], one standard deviation
  double psf_sigma_px = 0;  ///< standard deviation of the point spread function, lens and pixel together [px]
};

/// A frame camera. Pixel (u, v) = (column, row), (0, 0) at the CENTRE of the top-left pixel.
struct Camera {
  std::string name;
  int width = 0;                          ///< [px]
  int height = 0;                         ///< [px]
  double fx = 0, fy = 0, cx = 0, cy = 0;  ///< [px]
  BrownConrady distortion;
  Rigid3 cam_from_rig;
  std::optional<CameraSensor> sensor = {};  ///< nothing: not known

  /// Where a rig point is imaged [px], be it inside the picture or not; nothing if the point is behind the camera or
  /// beyond the distortion's valid radius.
  std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& rig_point) const;
  /// d project / d rig_point [px/mm]. \pre project(rig_point)
  Matrix23d project_jacobian(const Eigen::Vector3d& rig_point) const;
  /// The viewing ray of a picture position, in the rig frame; nothing if no direction is imaged there.
  std::optional<Ray> ray(const Eigen::Vector2d& pixel) const;
  Eigen::Vector3d center() const { return cam_from_rig.inverse().translation; }  ///< [mm] rig frame
  /// Whether a position lies on the picture, half a pixel of border included.
  bool sees(const Eigen::Vector2d& pixel) const {
    return pixel.x() >= -0.5 && pixel.y() >= -0.5 && pixel.x() <= width - 0.5 && pixel.y() <= height - 0.5;
  }
};

}  // namespace pagesweep
