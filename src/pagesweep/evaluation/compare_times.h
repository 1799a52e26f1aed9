// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "pagesweep/camera/light.h"
#include "pagesweep/data/time_map.h"
#include "pagesweep/evaluation/compare_points.h"

namespace pagesweep {

struct TimeComparisonOptions {
  double bright_amplitude = 70;
  double print_edge = 0.08;

  template <class Visitor>
  void describe(Visitor&& visit) {
    visit("bright-amplitude", bright_amplitude, "gray values", "pixels with a larger bell count as bright");
    visit("print-edge", print_edge, "1/px",
          "a pixel where the amplitude changes by a larger share counts as print edge");
  }
};

/// Time values of some kind of pixel against the truth.
struct TimeErrors {
  ErrorSummary error;                       ///< [frames] the common offset removed
  double claimed_rms = ErrorSummary::none;  ///< [frames] rms that the time values' own standard deviations predict

  double bound_rms = ErrorSummary::none;       ///< [frames] rms that no unbiased estimator can undercut
  double normalised_rms = ErrorSummary::none;  ///< of error over claim, value by value: 1 if they claim right

  double error_over_claim() const { return error.rms / claimed_rms; }
  double error_over_bound() const { return error.rms / bound_rms; }
};

struct TimeComparison {
  double offset_frames = ErrorSummary::none;  ///< what "the stripe's middle" means to the estimator, against the truth
  TimeErrors all, bright, dark;               ///< bright and dark by amplitude
  TimeErrors blank, print_edges;              ///< by the amplitude's gradient: inside one tone, or between two
  std::vector<TimeErrors> cameras;            ///< all pixels of each, the offset common to all
  std::vector<Image<float>> error_maps;       ///< [frames] one a camera, NaN where there is none
};

/// One camera's time values and what its pixels look at.
struct TimedView {
  const TimeMap* times = nullptr;
  const TruePoints* truth = nullptr;
};

/// Least standard deviation [frames] of a time value whose bell has this amplitude [gray values]; see TimeBound.
using BoundOfAmplitude = std::function<double(double amplitude_gray)>;

/// The true time of a pixel is when the light's middle plane passes its true point. The estimator may count from
/// another point of the stripe than its middle: the median difference over all cameras is removed, but no difference
/// between cameras, which would be an error of depth.
/// \param bound  may be empty: not known
/// \throws std::invalid_argument  if a view is incomplete or its sizes differ
TimeComparison compare_times(std::span<const TimedView> views, const Light& light,
                             const TimeComparisonOptions& options = {}, const BoundOfAmplitude& bound = {});

}  // namespace pagesweep
