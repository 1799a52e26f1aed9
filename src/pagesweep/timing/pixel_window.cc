// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/pixel_window_internal.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace pagesweep {
namespace {

double start_amplitude(const PixelWindow& window, double width, const StripeProfile& profile, const FrameNoise& noise) {
  float highest = 0;
  for (const float gray : window.gray) highest = std::isfinite(gray) && gray > highest ? gray : highest;
  // A longer exposure that was clipped below what a shorter one saw tells nothing.
  int clipped = 0;
  double ceiling = noise.sensor().ceiling;
  for (std::size_t k = 0; k < window.gray.size(); ++k) {
    const double own = noise.at(window.first_frame + static_cast<int>(k)).ceiling;
    if (!std::isinf(window.gray[k]) || own + 0.5 < highest) continue;
    ceiling = std::max(ceiling, own);
    ++clipped;
  }
  const double seen = std::max(highest - window.start.background, 1.0);
  if (clipped == 0) return seen;
  // The longer the plateau, the higher the bell must be that was cut off there.
  const double end = 0.5 * (clipped + 1) / width;
  const double cut_at = std::max(0.5 * (profile.value(-end) + profile.value(end)), 0.02);
  return std::max(seen, (ceiling - window.start.background) / cut_at);
}

}  // namespace

double reach_around(const StripeProfile& profile) {
  // Beyond the support there is background, which the fit wants to see too.
  return std::max(-profile.begin(), profile.end()) + 0.25 * profile.full_width_half_maximum() + 1;
}

PixelWindow make_window(std::span<const float> gray, int first_frame, double centre, double width,
                        const StripeProfile& profile, const FrameNoise& noise, std::span<const float> late) {
  float lowest = std::numeric_limits<float>::infinity();
  for (const float sample : gray) lowest = sample < lowest ? sample : lowest;
  PixelWindow window{gray, first_frame, {}, late};
  window.start.background = std::isfinite(lowest) ? lowest : 0;
  window.start.time = centre;
  window.start.width = width;
  window.start.amplitude = start_amplitude(window, width, profile, noise);
  return window;
}

}  // namespace pagesweep
