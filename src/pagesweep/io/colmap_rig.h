// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "pagesweep/camera/rig.h"

namespace pagesweep {

/// Reads cameras that COLMAP has calibrated, from the text form of a sparse model: every image is one camera of the
/// rig, in the order of the file, named as the image without its extension, slashes made underscores. The rig's frame
/// is the model's. Knows the camera models SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, and FULL_OPENCV with
/// k4 = k5 = k6 = 0. COLMAP's (0.5, 0.5) is the centre of the top-left pixel, ours is (0, 0).
/// \param cameras_file  cameras.txt: CAMERA_ID MODEL WIDTH HEIGHT PARAMS...
/// \param images_file   images.txt: IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, X_camera = R(Q) X_model + T; and a
///                      line of image points, which is passed over
/// \param mm_per_unit   the model's scale: COLMAP has no units
/// \throws Error  that names file, line and what was expected
Rig read_colmap_rig(const std::filesystem::path& cameras_file, const std::filesystem::path& images_file,
                    double mm_per_unit = 1);

/// Writes cameras.txt, images.txt and a points3D.txt without points: what COLMAP needs to go on from known cameras.
/// Images are called CAMERA.png; models are OPENCV, or FULL_OPENCV for a camera with k3. Scanner, light and sensors
/// have no place in it.
/// \param folder  is made if it is missing
/// \throws Error  if it holds anything or cannot be written, or a camera's name has a blank, at which COLMAP ends it
void write_colmap_rig(const std::filesystem::path& folder, const Rig& rig, double mm_per_unit = 1);

}  // namespace pagesweep
