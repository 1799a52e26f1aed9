// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/row_windows_internal.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace pagesweep {

RowWindows::RowWindows(const Frames& frames, const StripeProfile& profile, const FrameNoise& noise, bool keep_clipped)
    : frames_(frames),
      profile_(profile),
      noise_(noise),
      keep_clipped_(keep_clipped),
      reach_(reach_around(profile)),
      search_(profile.full_width_half_maximum()),
      rise_sigma_(search_.rise_sigma(noise)) {}

double RowWindows::reach_around(const StripeProfile& profile) {
  // Beyond the support there is background, which the fit wants to see too.
  return std::max(-profile.begin(), profile.end()) + 0.25 * profile.full_width_half_maximum() + 1;
}

void RowWindows::read(int y, int left, int columns) {
  left_ = left;
  if (samples_.width() != columns || samples_.height() != frames_.count())
    samples_ = Image<float>(columns, frames_.count());
  const bool clipped = frames_.read_row(y, left, samples_);
  search_.find(samples_, noise_, clipped);
}

PixelWindow RowWindows::window_at(int x, double width, int centre) {
  const int reach = static_cast<int>(std::ceil(reach_ * width));
  const int begin = std::max(0, centre - reach), end = std::min(frames_.count(), centre + reach + 1);
  gray_.clear();
  float lowest = std::numeric_limits<float>::infinity();
  for (int i = begin; i < end; ++i) {
    const float gray = samples_(x - left_, i);
    lowest = gray < lowest ? gray : lowest;
    const bool is_naive = keep_clipped_ && std::isinf(gray);
    gray_.push_back(is_naive ? static_cast<float>((noise_.sensor().ceiling + 0.5) / noise_.exposure(i)) : gray);
  }
  PixelWindow window{gray_, begin, {}};
  window.start.background = std::isfinite(lowest) ? lowest : 0;
  window.start.time = centre;
  window.start.width = width;
  window.start.amplitude = start_amplitude(window, width);
  return window;
}

double RowWindows::start_amplitude(const PixelWindow& window, double width) const {
  float highest = 0;
  for (const float gray : window.gray) highest = std::isfinite(gray) && gray > highest ? gray : highest;
  // A longer exposure that was clipped below what a shorter one saw tells nothing.
  int clipped = 0;
  double ceiling = noise_.sensor().ceiling;
  for (std::size_t k = 0; k < window.gray.size(); ++k) {
    const double own = noise_.at(window.first_frame + static_cast<int>(k)).ceiling;
    if (!std::isinf(window.gray[k]) || own + 0.5 < highest) continue;
    ceiling = std::max(ceiling, own);
    ++clipped;
  }
  const double seen = std::max(highest - window.start.background, 1.0);
  if (clipped == 0) return seen;
  // The longer the plateau, the higher the bell must be that was cut off there.
  const double end = 0.5 * (clipped + 1) / width;
  const double cut_at = std::max(0.5 * (profile_.value(-end) + profile_.value(end)), 0.02);
  return std::max(seen, (ceiling - window.start.background) / cut_at);
}

}  // namespace pagesweep
