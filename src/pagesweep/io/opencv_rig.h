// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>

#include "pagesweep/camera/rig.h"

namespace pagesweep {

/// What OpenCV's files leave open.
struct OpenCvHints {
  double mm_per_unit = 1;     ///< the unit in which the calibration board was measured
  int width = 0, height = 0;  ///< [px] for files without image_width and image_height; 0: not known
};

/// Reads cameras that OpenCV has calibrated, from YAML written by cv::FileStorage. The files may be
/// - one with `camera_matrix`, `distortion_coefficients`, `image_width`, `image_height`, as OpenCV's calibration sample
///   writes: a rig of one camera;
/// - `M1 D1 M2 D2` and `R T`, as its stereo sample writes, in one file or two: X_camera2 = R X_camera1 + T. In place
///   of M1 to D2, two of the former, in the order of the cameras;
/// - one of write_opencv_rig().
///
/// Cameras are named cam1 and cam2. The rig's frame is that of the first camera, unless a `rotation` and `translation`
/// say X_camera1 = rotation X_rig + translation. OpenCV's pixels and distortion are ours; it has no units.
/// \throws Error  that names file, field and what was expected: for fisheye lenses, for coefficients beyond k3 that are
///                not 0, for a rotation that is none
Rig read_opencv_rig(std::span<const std::filesystem::path> files, const OpenCvHints& hints = {});

/// Writes one file for cv::FileStorage: of a single camera the fields that OpenCV's calibration sample writes, of
/// several a block of these a camera, under its name; and `rotation` and `translation`, X_camera = rotation X_rig +
/// translation. Scanner, light and sensors have no place in it.
/// \throws Error  if it cannot be written, or a camera's name cannot be a name in such a file
void write_opencv_rig(const std::filesystem::path& file, const Rig& rig, double mm_per_unit = 1);

/// Writes intrinsics.yml (`M1 D1 M2 D2`) and extrinsics.yml (`R T`), as OpenCV's stereo sample does, with the pictures'
/// size and the first camera's place in the rig as further fields.
/// \throws Error  if they cannot be written, or the rig has not two cameras of one size
void write_opencv_stereo(const std::filesystem::path& folder, const Rig& rig, double mm_per_unit = 1);

}  // namespace pagesweep
