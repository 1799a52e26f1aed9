// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "pagesweep/camera/rigid3.h"
#include "pagesweep/camera/scanner.h"
#include "pagesweep/camera/scanner_model.h"

namespace pagesweep {

/// The mapping of a plane to a picture, by the normalised direct linear transform (Hartley 1997).
/// \return picture from plane, of unit norm; nothing with fewer than four points or if they lie in a line
std::optional<Eigen::Matrix3d> find_homography(std::span<const Eigen::Vector2d> plane,
                                               std::span<const Eigen::Vector2d> picture);

/// Focal length [px] of a camera without distortion whose principal point is known and whose pixels are square, from
/// views of a plane (Zhang 2000): with B = diag(1/f^2, 1/f^2, 1), h1' B h2 = 0 and h1' B h1 = h2' B h2.
/// \param picture_from_plane  with the principal point as the picture's origin
/// \return nothing if no view is tilted enough to tell
std::optional<double> find_focal_length(std::span<const Eigen::Matrix3d> picture_from_plane);

/// Pose of a plane from its homography, picture coordinates being (u - cx, v - cy) / f.
Rigid3 pose_from_homography(const Eigen::Matrix3d& image_from_plane);

/// Points in the rig frame and where the scan shows them.
struct ScanPoints {
  int width = 0, height = 0;  ///< of the scan [px]
  std::vector<Eigen::Vector3d> rig_mm;
  std::vector<Eigen::Vector2d> pixels;
};

/// A scanner's parameters from closed forms without distortion (docs/derivations/calibration.md).
/// \return nothing if the points do not determine them: too few, or all in one plane
std::optional<Scanner::Model> find_scanner(ScannerModel model, const ScanPoints& points);

/// Whether points seen in a scan show that it is mirrored.
bool is_mirrored(const ScanPoints& points);

}  // namespace pagesweep
