// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

#include "pagesweep/timing/bell_fit.h"
#include "pagesweep/timing/sensor_noise.h"
#include "pagesweep/timing/stripe_profile.h"

namespace pagesweep {

/// The part of one pixel's gray value sequence that surrounds the stripe, and what a first look at it tells.
struct PixelWindow {
  std::span<const float> gray;       ///< consecutive samples; NaN: dropped, +infinity: clipped
  int first_frame = 0;               ///< time of gray[0]
  Bell start;                        ///< rough, good enough to start any estimator from
  std::span<const float> late = {};  ///< [frames] by which each sample was exposed later; empty: not at all

  double late_of(std::size_t k) const { return late.empty() ? 0 : static_cast<double>(late[k]); }
  double time_of(std::size_t k) const { return first_frame + static_cast<double>(k) + late_of(k); }
};

/// [frames] to both sides of the stripe's middle, at width 1, that a window has.
double reach_around(const StripeProfile& profile);

/// The middle of the plateau of clipped samples that is met within `near` entries of `centre`; `centre` if there is
/// none. A dropped frame does not end a plateau.
/// \param is_clipped, is_there  tell it of entries 0 ... count - 1
template <class IsClipped, class IsThere>
int plateau_middle(int centre, int near, int count, const IsClipped& is_clipped, const IsThere& is_there) {
  const auto goes_on = [&](int k) { return is_clipped(k) || !is_there(k); };
  int begin = std::max(0, centre - near);
  const int stop = std::min(count, centre + near + 1);
  while (begin < stop && !(is_clipped(begin) && is_there(begin))) ++begin;
  if (begin == stop) return centre;
  int end = begin;
  while (end < count && goes_on(end)) ++end;
  while (begin > 0 && goes_on(begin - 1)) --begin;
  return (begin + end - 1) / 2;
}

/// Takes a first look at samples.
/// \param centre  [frames] where the bell is expected
/// \param width   of the stripe there, relative to the profile's
/// \param late    see PixelWindow
PixelWindow make_window(std::span<const float> gray, int first_frame, double centre, double width,
                        const StripeProfile& profile, const FrameNoise& noise, std::span<const float> late = {});

}  // namespace pagesweep
