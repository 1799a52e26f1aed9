// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "pagesweep/data/frames.h"
#include "pagesweep/timing/pixel_window_internal.h"
#include "pagesweep/timing/stripe_search_internal.h"

namespace pagesweep {

/// Reads the pixels of one camera row by row and cuts the stripe's surroundings out of each sequence. One a thread.
class RowWindows {
 public:
  /// \param keep_clipped  clipped samples stay in as if the saturation level had been measured (the naive way)
  RowWindows(const Frames& frames, const StripeProfile& profile, const FrameNoise& noise, bool keep_clipped = false);

  void read(int y) { read(y, 0, frames_.width()); }
  /// Only the pixels from column `left` on; others must then not be asked for.
  void read(int y, int left, int columns);
  /// How many standard deviations the stripe search's response lies above what noise alone would give.
  double significance(int x) const { return search_.rise(x - left_) / rise_sigma_; }
  /// \param width  of the stripe there, relative to the profile's
  PixelWindow window(int x, double width) { return window_at(x, width, frame(x)); }
  PixelWindow window_at(int x, double width, int centre);
  int frame(int x) const { return search_.frame(x - left_); }  ///< nearest to the stripe's middle

 private:
  const Frames& frames_;
  const StripeProfile& profile_;
  const FrameNoise& noise_;
  const bool keep_clipped_;
  const double reach_;
  StripeSearch search_;
  double rise_sigma_;
  int left_ = 0;  ///< column of samples_(0, i)
  Image<float> samples_;
  std::vector<float> gray_, late_;
};

}  // namespace pagesweep
