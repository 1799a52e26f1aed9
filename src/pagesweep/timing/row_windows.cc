// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/row_windows_internal.h"

#include <algorithm>
#include <cmath>

namespace pagesweep {

RowWindows::RowWindows(const Frames& frames, const StripeProfile& profile, const FrameNoise& noise, bool keep_clipped)
    : frames_(frames),
      profile_(profile),
      noise_(noise),
      keep_clipped_(keep_clipped),
      reach_(reach_around(profile)),
      search_(profile.full_width_half_maximum()),
      rise_sigma_(search_.rise_sigma(noise)) {}

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
  late_.clear();
  for (int i = begin; i < end; ++i) {
    const float gray = samples_(x - left_, i);
    const bool is_naive = keep_clipped_ && std::isinf(gray);
    gray_.push_back(is_naive ? static_cast<float>((noise_.sensor().ceiling + 0.5) / noise_.exposure(i)) : gray);
    if (!frames_.is_even()) late_.push_back(frames_.late(i));
  }
  return make_window(gray_, begin, centre, width, profile_, noise_, late_);
}

}  // namespace pagesweep
