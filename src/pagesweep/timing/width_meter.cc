// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/width_meter_internal.h"

#include <algorithm>

namespace pagesweep {

WidthMeter::WidthMeter(const StripeWindows& windows, const BellTables& tables, const StripeProfile& profile,
                       const FrameNoise& noise)
    : windows_(windows),
      profile_(profile),
      noise_(noise),
      alone_(windows, profile, noise),
      bells_(tables, noise.sensor(), profile.full_width_half_maximum()),
      reader_(windows, bells_, profile.full_width_half_maximum()) {}

float WidthMeter::measure(const WidthTile& tile) {
  widths_.clear();
  for_width_pixels(tile, [&](int x, int y) { add(x, y); });
  fit_waiting();
  return robust_width(widths_);
}

void WidthMeter::add(int x, int y) {
  if (windows_.centre(x, y) == StripeWindows::none || windows_.significance(x, y) < least_significance_of_width) return;
  BellSamples samples;
  reader_.read(x, y, 0, static_cast<int>(waiting_.size()), samples);
  using enum BellSamples::Kind;
  if (samples.kind == core || samples.kind == partial || samples.kind == clipped) {
    waiting_.push_back(samples);
    if (waiting_.size() == most_bells) fit_waiting();
    return;
  }
  alone_.read(y);
  measure_width_alone(alone_.window(x, 1), profile_, noise_, widths_);
}

void WidthMeter::fit_waiting() {
  using enum BellSamples::Kind;
  for (const BellSamples::Kind kind : {core, partial, clipped}) {
    bells_.clear();
    for (const BellSamples& samples : waiting_)
      if (samples.kind == kind) reader_.add_to(bells_, samples);
    if (bells_.count() == 0) continue;
    bells_.fit_widths(BellSamples::content_of(kind));
    for (int i = 0; i < bells_.count(); ++i) {
      const PlainBells::Fit bell = bells_[i];
      if (bell.converged)
        note_width(bell.log_width, bell.log_width_sigma, bell.chi_square / std::max(1, bell.samples - 4), widths_);
    }
  }
  waiting_.clear();
}

}  // namespace pagesweep
