// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "pagesweep/data/time_map.h"
#include "pagesweep/timing/pixel_time_internal.h"
#include "pagesweep/timing/plain_bells_internal.h"
#include "pagesweep/timing/recorded_windows_internal.h"
#include "pagesweep/timing/stripe_width.h"

namespace pagesweep {

/// Refined time values from recorded windows. Nearly all pixels are plain cases, which vectors fit some at once; the
/// others are looked at one by one. One a thread.
class TileTimes {
 public:
  /// The arguments must outlive this.
  TileTimes(const StripeWindows& windows, const BellTables& tables, const StripeWidths& widths, const PixelJudge& judge,
            TimeMap& map);

  /// The pixels left, left + 1, ... of row y.
  void estimate(int y, int left, int columns);

 private:
  struct Candidate {
    int x;       ///< column
    int centre;  ///< [frames] of the bell, nearly
    double log_width;
    bool may_be_noise;   ///< a bell at the limit of judge_bell(): if it cannot be fitted it is none
    const float* light;  ///< its samples, black level removed, from the window's first on
  };

  void gather(int y, int left, int columns);
  bool is_clipped(const Candidate& candidate) const;
  /// How its samples were taken.
  enum class Sampling { whole, partial, uneven, too_uneven };
  Sampling sampling(const Candidate& candidate) const;
  void fit(Sampling sampling, int y);
  /// \param plain  its fit as a plain case, which did not do; null: there is none
  PixelTime look_closely(const Candidate& candidate, const PlainBells::Fit* plain = nullptr);
  /// Whether every frame is there that shows something of the bell.
  bool is_recorded(const PixelTime& time, double log_width) const;
  /// The verdict on a bell of which samples are missing.
  PixelStatus judge_partial(const Candidate& candidate, const PixelTime& time);

  const StripeWindows& windows_;
  const StripeWidths& widths_;
  const PixelJudge& judge_;
  TimeMap& map_;
  RecordedWindows alone_;
  PlainBells bells_;
  std::vector<float> light_;
  std::vector<float> log_widths_;
  std::vector<float> window_;
  std::vector<Candidate> candidates_, fitted_;
};

}  // namespace pagesweep
