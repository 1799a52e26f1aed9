// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "pagesweep/camera/rig.h"

namespace pagesweep {

/// Reads the camera chain of Kalibr ("camchain.yaml"): pinhole cameras with radtan distortion or none, in metres, each
/// placed against the one before it by T_cn_cnm1. Cameras are named cam0, cam1, ... as in the file. The rig's frame is
/// that of cam0, unless the file has a T_cam_rig there, as write_kalibr_rig() does. Whatever it says about an inertial
/// sensor is passed over.
/// \throws Error  that names file, field and what was expected: for other camera models, for a rotation that is none
Rig read_kalibr_rig(const std::filesystem::path& file);

/// Writes a camera chain for Kalibr: cameras in the order of the rig, called cam0, cam1, ... Their own names, scanner,
/// light and sensors have no place in it.
/// \throws Error  if it cannot be written, or a camera has k3, which radtan has not
void write_kalibr_rig(const std::filesystem::path& file, const Rig& rig);

}  // namespace pagesweep
