// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "pagesweep/data/correspondences.h"
#include "pagesweep/data/frames.h"
#include "pagesweep/data/time_map.h"
#include "pagesweep/timing/estimate_times.h"
#include "pagesweep/timing/shift_equations.h"

namespace pagesweep {

/// Time value tau(g, f) of one gray value sequence against another, eq. 3-11: g comes c frames later than f. The start
/// value is the difference of the peak positions; the middle of a clipped plateau counts as its peak.
/// \param interval  length of the piece of f around its peak that is matched [frames]; the paper uses 30
/// \return nothing if too few good samples are left
std::optional<Shift> match_gray_values(std::span<const float> f, std::span<const float> g, int interval = 30);

/// The `pairwise` estimator: moves each match to where the two cameras' gray value sequences coincide. The sequence of
/// the pixel in `from` is f, that at (u, v) in `to`, bilinear in space, is g; where g comes c frames late, the match
/// moves by -c along the gradient of to_times, c / |gradient| pixels far.
///
/// Statuses stay. A match whose sequences give no shift, or a shift of more than a stripe's width, stays where it is.
/// \param to_times  time values of `to`: their gradient, and the place of the stripe in the recording
Correspondences shift_pairwise(const Correspondences& matches, const Frames& from, const Frames& to,
                               const TimeMap& to_times, const TimingOptions& options);

}  // namespace pagesweep
