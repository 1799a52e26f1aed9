// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "pagesweep/data/frames.h"
#include "pagesweep/timing/sensor_noise.h"
#include "pagesweep/timing/stripe_profile.h"

namespace pagesweep {

/// What a capture tells about its stripe and its cameras.
struct LearnedStripe {
  StripeProfile profile;
  std::vector<SensorNoise> noise;  ///< one a camera, ceilings set
};

/// The stripe's profile and the cameras' noise from the capture itself. No shape is assumed.
///
/// From a fixed random subset of bright pixels of ALL cameras (a common profile, so that whatever is wrong with it is
/// wrong for both in the same way): fit the profile so far to each sequence, bring the samples to common time, height
/// and width, take robust means in bins of a fraction of a frame, fit a smoothing spline, repeat. Pixels with a clipped
/// sample take part only if too few have none; then the flanks alone speak.
/// \param most_pixels  that take part, all cameras together
/// \throws Error no_result  if no stripe passes in the frames
LearnedStripe learn_stripe(std::span<const Frames> cameras, int most_pixels = 3000);

}  // namespace pagesweep
