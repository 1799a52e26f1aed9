// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/planning/time_variance.h"

namespace pagesweep {

/// The light on the paper and the sensor that records it.
struct RecordingPlan {
  double amplitude = 0.7;
  double full_well_electrons = 10000;
  double read_noise_electrons = 15;
  int bits = 8;
  double stripe_mm = 12;
  double exposure_frames = 0;

  template <class Visitor>
  void describe(Visitor&& visit) {
    visit("amplitude", amplitude, "share",
          "how far the stripe lifts the paper, as a share of what clips: 0.7 leaves a margin, print has a tenth of it, "
          "above 1 is clipped");
    visit("full-well", full_well_electrons, "electrons", "photoelectrons that make the highest gray value");
    visit("read-noise", read_noise_electrons, "electrons", "noise of the sensor in the dark");
    visit("bits", bits, "", "gray depth");
    visit("stripe-mm", stripe_mm, "mm", "width of the stripe on the table, at half its height");
    visit("exposure", exposure_frames, "frames",
          "how long the shutter is open: the stripe moves on meanwhile; 0: counted in --stripe-mm already");
  }
};

/// The bound of a time value whose bell is a Gaussian stripe that moves on during the exposure, its variance averaged
/// over the positions of the bell between two frames.
/// \param mm_per_frame  speed of the stripe on the table, above 0
/// \return              infinity where it tells less than which frame is brightest: the stripe falls between the
/// frames,
///                      drowns in noise, or is clipped
/// \throws std::invalid_argument  names the option that cannot be meant
TimeVariance plan_time(const RecordingPlan& recording, double mm_per_frame);

/// The width at which plan_time() is least, if the peak keeps its brightness: a narrower stripe has steeper flanks
/// until the frames miss them.
/// \return  [mm] to a hundredth of itself
double best_stripe_mm(const RecordingPlan& recording, double mm_per_frame);

}  // namespace pagesweep
