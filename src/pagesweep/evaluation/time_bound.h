// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "pagesweep/io/truth_file.h"

namespace pagesweep {

/// The Cramér-Rao bound of a time value: how small its standard deviation can be at best, for an estimator that knows
/// the stripe's profile p but neither amplitude A nor background b of the pixel's bell A p(i - t) + b. The noise of a
/// sample is that of an EMVA 1288 sensor: shot noise (A p / gain), read noise, and rounding to whole gray values
/// (1/12). Clipped samples carry no information. Amplitudes are those of the longest exposure.
class TimeBound {
 public:
  /// \param clips_at_gray  first gray value above black that is clipped
  /// \param exposures      of the frames, in turn, relative to the longest; empty: all alike
  /// \throws std::invalid_argument  if the profile has fewer than three samples or no step, or the gain is not positive
  TimeBound(const TruthProfile& profile, const TruthSensor& sensor, double clips_at_gray,
            std::vector<double> exposures = {});

  /// Root of the mean variance over all positions of the bell between two frames and among the exposures.
  /// \return  [frames]; infinity where the samples do not determine a time, NaN if the amplitude is not positive
  double operator()(double amplitude_gray) const;

 private:
  double variance(double amplitude_gray, double middle_frames) const;
  double light_at(double frames) const;

  TruthProfile profile_;
  TruthSensor sensor_;
  double clips_at_gray_;
  std::vector<double> exposures_;
  std::vector<double> table_;  ///< bounds at amplitudes in geometric steps
};

}  // namespace pagesweep
