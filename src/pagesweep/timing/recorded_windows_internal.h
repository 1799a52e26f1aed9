// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "pagesweep/timing/pixel_window_internal.h"
#include "pagesweep/timing/stripe_windows_internal.h"

namespace pagesweep {

/// Reads single pixels of what a StripeRecorder kept, as RowWindows does from whole frames. One a thread.
class RecordedWindows {
 public:
  /// The arguments must outlive this.
  RecordedWindows(const StripeWindows& windows, const StripeProfile& profile, const FrameNoise& noise);

  void read(int y) { y_ = y; }
  void read(int y, int /*left*/, int /*columns*/) { y_ = y; }
  double significance(int x) const { return windows_.significance(x, y_); }
  /// Nearest to the stripe's middle; where samples are clipped, the middle of the plateau. \pre a stripe passed
  int frame(int x) const;
  /// \param width  of the stripe there, relative to the profile's
  PixelWindow window(int x, double width) { return window_at(x, width, frame(x)); }
  PixelWindow window_at(int x, double width, int centre);

 private:
  const StripeWindows& windows_;
  const StripeProfile& profile_;
  const FrameNoise& noise_;
  const double reach_;
  int y_ = 0;
  std::vector<float> gray_, late_;
};

}  // namespace pagesweep
