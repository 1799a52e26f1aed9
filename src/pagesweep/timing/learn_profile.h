// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
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

inline constexpr int default_pupils = 3000;

/// The stripe's profile and the cameras' noise from the capture itself. No shape is assumed.
///
/// From a fixed random subset of bright pixels of ALL cameras (a common profile, so that whatever is wrong with it is
/// wrong for both in the same way): fit the profile so far to each sequence, bring the samples to common time, height
/// and width, take robust means in bins of a fraction of a frame, fit a smoothing spline, repeat. Pixels with a clipped
/// sample take part only if too few have none; then the flanks alone speak.
///
/// The stripe is learned as soon as enough pixels have seen it pass, from the frames up to then: a first part of the
/// sweep teaches as well as the whole (docs/decisions.md), and what is learned early lets the time values keep up with
/// the frames.
/// \param most_pixels  that take part, all cameras together; that many are also enough
/// \throws Error no_result  if no stripe passes in the frames
LearnedStripe learn_stripe(std::span<const Frames> cameras, int most_pixels = default_pupils);

/// The number of frames after which learning is tried again, when it was tried in vain after `end` (or 0) frames.
int next_lesson(int end);

class PupilSearch;

/// The same while the frames arrive.
class StripeLearner {
 public:
  explicit StripeLearner(int most_pixels = default_pupils);
  ~StripeLearner();

  /// From the frames before `end` alone. Frames are told apart from dropped ones by nothing else.
  /// \param end  a next_lesson(), later than before; if it is the number of frames, there is no waiting for more
  /// \return nothing if too few pixels have seen the stripe by then
  /// \throws Error no_result  if no stripe passes in all frames
  std::optional<LearnedStripe> learn(std::span<const Frames> cameras, int end);
  /// When there will be no more frames.
  /// \param end  the next lesson that was not tried
  LearnedStripe learn_from_all(std::span<const Frames> cameras, int end);

 private:
  int most_pixels_;
  std::vector<PupilSearch> searches_;  ///< one a camera
};

}  // namespace pagesweep
