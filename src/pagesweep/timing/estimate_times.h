// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <span>
#include <string_view>
#include <vector>

#include "pagesweep/base/progress.h"
#include "pagesweep/data/frames.h"
#include "pagesweep/data/time_map.h"
#include "pagesweep/timing/sensor_noise.h"
#include "pagesweep/timing/stripe_profile.h"
#include "pagesweep/timing/stripe_width.h"

namespace pagesweep {

/// How a pixel's time value is found. All are kept, so that anyone can compare them.
enum class TimeEstimator {
  center_of_mass,  ///< of what rises above a fifth of the bell; a start value
  pairwise,        ///< eq. 3-9 between the sequences of two corresponding pixels, see shift_pairwise()
  profile,         ///< eq. 8-10 against the learned profile
  refined,         ///< maximum likelihood against the smooth profile: reaches the Cramer-Rao bound
};

constexpr auto names_of(TimeEstimator) {
  return std::array<std::string_view, 4>{"center-of-mass", "pairwise", "profile", "refined"};
}

struct TimingOptions {
  TimeEstimator estimator = TimeEstimator::refined;
  double min_amplitude = 0;
  double max_sigma = 0.5;
  bool use_saturated = false;
  bool uniform_width = false;

  template <class Visitor>
  void describe(Visitor&& visit) {
    visit("estimator", estimator, "", "how time values are found");
    visit("min-amplitude", min_amplitude, "gray values",
          "a bell that rises less is too dark; 0: whatever still gives a time within max-sigma");
    visit("max-sigma", max_sigma, "frames", "a time value less certain than this counts as too dark");
    visit("use-saturated", use_saturated, "",
          "take clipped samples for measurements: the naive way, for comparison with eq. 10-11");
    visit("uniform-width", uniform_width, "", "take the stripe to be equally wide in all parts of the picture");
  }
};

/// What the frames of all cameras tell about when the stripe passed.
struct Timing {
  StripeProfile profile;             ///< one for all cameras
  std::vector<SensorNoise> noise;    ///< one a camera
  std::vector<StripeWidths> widths;  ///< one a camera
  std::vector<TimeMap> maps;         ///< one a camera
};

/// Time values of every pixel of every camera against ONE profile, learned from these frames: whatever is wrong with it
/// shifts the times of all cameras alike and cancels when they are matched. `pairwise` begins with the maps of
/// `profile`; it acts on matches.
/// \throws Error no_result        if no stripe passes
/// \throws std::invalid_argument  if there is no camera
Timing estimate_times(std::span<const Frames> cameras, const TimingOptions& options = {},
                      Progress& progress = no_progress());

/// The time values of one camera when profile, noise and widths are known.
TimeMap estimate_times(const Frames& frames, const StripeProfile& profile, const SensorNoise& noise,
                       const StripeWidths& widths, const TimingOptions& options);

}  // namespace pagesweep
