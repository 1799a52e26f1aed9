// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "pagesweep/camera/rig.h"

namespace pagesweep {

/// Reads a rig (docs/formats.md, "Rig"). Every model is checked: sizes, focal lengths, rotations, unit vectors, steps.
/// \throws Error  that names file, field and what was expected
Rig read_rig(const std::filesystem::path& file);

/// \throws Error  if it cannot be written
/// \throws std::invalid_argument  if a number of the rig is not finite
void write_rig(const std::filesystem::path& file, const Rig& rig);

}  // namespace pagesweep
