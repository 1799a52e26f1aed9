// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "pagesweep/data/frames.h"
#include "pagesweep/data/time_map.h"
#include "pagesweep/timing/stripe_profile.h"

namespace pagesweep {

/// How well a camera's range of gray values was used in a sweep, and what would use it better.
struct ExposureAdvice {
  double clipped_share = 0;  ///< of the pixels that the stripe passed: those that were clipped in some frame
  double dark_share = 0;     ///< of the same: those that gave no time because the stripe hardly showed
  double top = 0;            ///< gray value without black level that 1 in 200 of them rises above, over what can be had
  double light_factor = 1;   ///< light, that is exposure time or gain, times this uses the range well
  double stripe_frames = 0;  ///< width of the stripe at half height
  double speed_factor = 1;   ///< motion of the stripe from frame to frame times this suits time values
  bool is_good = true;       ///< no change is worth the trouble
};

/// A pixel whose bell is clipped is worth less, but not nothing (eq. 10), and one that is twice as dark has some 1.4
/// times the noise: light is right if 1 pixel in 200 just reaches the range's end. A stripe of less than 4 frames is
/// badly sampled; one of more than 16 takes time and tells nothing more for it, as noise of a time value grows with the
/// root of the width in frames.
/// \param clipped  in how many frames each pixel was
ExposureAdvice advise_exposure(const Sequence& sequence, const TimeMap& times, const Image<std::uint8_t>& clipped,
                               const StripeProfile& profile);

/// In words, for the operator.
/// \param exposure_ms  0: not known
/// \param interval_ms  between frames, which no exposure can be longer than; 0: not known
std::string describe(const ExposureAdvice& advice, double exposure_ms = 0, double interval_ms = 0);

}  // namespace pagesweep
