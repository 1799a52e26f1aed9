// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

#include "pagesweep/data/frames.h"

namespace pagesweep {

using Clock = std::chrono::steady_clock;

/// A frame as a camera sent it.
struct LiveFrame {
  std::int64_t number = 0;        ///< counted by the camera from the first one that came; what is left out was lost
  std::int64_t timestamp_ns = 0;  ///< of the exposure, by the camera's own clock
  Clock::time_point arrival;
  GrayImage image;
};

/// What became of the frames of one camera.
struct FrameCounts {
  std::int64_t received = 0;  ///< whole frames
  std::int64_t damaged = 0;   ///< frames of which packets are missing; they are not used
  std::int64_t lost = 0;      ///< frames of which nothing came, as the camera's own count shows
  std::int64_t unpaired = 0;  ///< whole frames without a partner
  std::int64_t late = 0;      ///< whole frames that came too late to be put in order; they are not used
};

}  // namespace pagesweep
