// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "pagesweep/base/image.h"
#include "pagesweep/base/progress.h"
#include "pagesweep/data/frames.h"
#include "pagesweep/timing/estimate_times.h"

namespace pagesweep {

/// A board as the cameras saw it under the moving stripe.
struct BoardSweep {
  std::vector<Image<std::uint8_t>>
      textures;   ///< one a camera: what is printed there, as a picture with 255 its highest
  Timing timing;  ///< when the stripe passed, and what each sensor's noise is
};

/// Follows a sweep over a calibration board. A texture is the map of amplitudes: the light that the stripe alone adds,
/// without the room's, and with less noise than the brightest frame's.
/// \throws Error no_result  if no stripe passes
BoardSweep watch_board(FrameSource& frames, Progress& progress = no_progress());

}  // namespace pagesweep
