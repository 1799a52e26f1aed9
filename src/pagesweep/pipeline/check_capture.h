// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/base/progress.h"
#include "pagesweep/camera/rig.h"
#include "pagesweep/data/frames.h"
#include "pagesweep/data/picture.h"
#include "pagesweep/drift/check_rig.h"

namespace pagesweep {

/// Whether a rig still describes the instrument that took an ordinary scan: points by stereo alone, then check_rig().
/// \param scan  the scanner's picture, if there is one
/// \throws Error  (bad_input) if rig and capture do not belong together; (no_result) if there is too little print
RigCheck check_capture(FrameSource& frames, const Rig& rig, const Picture* scan, const DriftPriors& priors = {},
                       Progress& progress = no_progress());

}  // namespace pagesweep
