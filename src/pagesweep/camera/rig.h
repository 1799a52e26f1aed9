// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "pagesweep/camera/camera.h"
#include "pagesweep/camera/light.h"
#include "pagesweep/camera/scan_light.h"
#include "pagesweep/camera/scanner.h"

namespace pagesweep {

/// The calibrated instrument. Rig frame: right-handed, x along the light stripe, y along the sweep, z up from the table
/// towards the cameras; millimetres.
struct Rig {
  std::vector<Camera> cameras;
  std::optional<Scanner> scanner;
  std::optional<Light> light;
  std::optional<LampBar> lamp;          ///< where that light comes from
  std::optional<WhiteReference> white;  ///< what the scanner makes of white

  /// The camera with that name, or nullptr.
  const Camera* find_camera(std::string_view name) const;
};

}  // namespace pagesweep
