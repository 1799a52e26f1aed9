// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/camera/camera.h"

namespace pagesweep {

/// Largest r^2, up to that of 76 degrees off the axis, to which the distortion is valid.
double largest_valid_radius_squared(const BrownConrady& lens);

}  // namespace pagesweep
