// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "pagesweep/data/time_map.h"
#include "pagesweep/timing/bell_samples_internal.h"
#include "pagesweep/timing/pixel_time_internal.h"
#include "pagesweep/timing/recorded_windows_internal.h"
#include "pagesweep/timing/stripe_width.h"

namespace pagesweep {

/// Refined time values from recorded windows. Nearly all pixels are fitted some at once in vectors; the others are
/// looked at one by one. One a thread.
class TileTimes {
 public:
  /// The arguments must outlive this.
  TileTimes(const StripeWindows& windows, const BellTables& tables, const StripeWidths& widths, const PixelJudge& judge,
            TimeMap& map);

  /// The pixels left, left + 1, ... of row y.
  void estimate(int y, int left, int columns);

 private:
  struct Candidate {
    int x = 0;  ///< column
    BellSamples samples;
    bool may_be_noise = false;  ///< a bell at the limit of judge_bell(): if it cannot be fitted it is none
  };

  /// A pixel whose residuals are more than noise.
  struct Doubtful {
    const Candidate* candidate;
    PlainBells::Fit bell;
  };

  void gather(int y, int left, int columns);
  void fit(BellSamples::Kind kind, int y);
  void set_whole(int x, int y, std::size_t i);
  void ask_for_second_opinions(int y);
  /// The verdict of the fit, if it is one.
  std::optional<PixelTime> time_of(const Candidate& candidate, const PlainBells::Fit& bell) const;
  /// \param plain  its fit as a plain case, which did not do; null: there is none
  PixelTime look_closely(const Candidate& candidate, const PlainBells::Fit* plain = nullptr);
  /// Whether every frame is there that shows something of the bell.
  bool is_recorded(const BellSamples& samples, double time, double width) const;
  BellPlace place_of(const BellSamples& samples, double time) const;
  static double width_of(const BellSamples& samples);

  const StripeWindows& windows_;
  const StripeWidths& widths_;
  const PixelJudge& judge_;
  TimeMap& map_;
  RecordedWindows alone_;
  PlainBells bells_;
  BellReader reader_;
  std::vector<float> log_widths_;
  std::vector<Candidate> candidates_;
  std::vector<const Candidate*> fitted_;
  std::vector<Doubtful> doubtful_;
  BellVerdicts verdicts_;
};

}  // namespace pagesweep
