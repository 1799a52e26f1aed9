// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/camera/rigid3.h"

namespace pagesweep::sim {

/// A camera at `center` that looks at `target`, its picture's columns along rig x, then turned by `roll_rad` about its
/// optical axis. \pre the view is not along rig x
Rigid3 looking_at(const Eigen::Vector3d& center, const Eigen::Vector3d& target, double roll_rad = 0);

}  // namespace pagesweep::sim
