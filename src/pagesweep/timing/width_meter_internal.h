// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "pagesweep/timing/bell_samples_internal.h"
#include "pagesweep/timing/recorded_windows_internal.h"
#include "pagesweep/timing/width_tiles_internal.h"

namespace pagesweep {

/// Measures the stripe's width in tiles of recorded windows. Nearly all pixels are plain cases, which vectors fit some
/// at once. One a thread.
class WidthMeter {
 public:
  /// The arguments must outlive this.
  /// \pre the tables cover all widths
  WidthMeter(const StripeWindows& windows, const BellTables& tables, const StripeProfile& profile,
             const FrameNoise& noise);

  /// Logarithm of the relative width in one tile; NaN where there is too little light.
  float measure(const WidthTile& tile);

 private:
  void add(int x, int y);
  void fit_waiting();

  const StripeWindows& windows_;
  const StripeProfile& profile_;
  const FrameNoise& noise_;
  RecordedWindows alone_;
  PlainBells bells_;
  BellReader reader_;
  std::vector<BellSamples> waiting_;
  std::vector<MeasuredWidth> widths_;
};

}  // namespace pagesweep
