// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/base/image.h"

namespace pagesweep {

/// How straight a page's text lines are, by their baselines.
struct LineStraightness {
  int lines = 0;                 ///< that were long enough to tell
  double rms_mm = 0;             ///< of the baselines from the straight line through each
  double largest_in_100_mm = 0;  ///< deviation within 100 mm of a line, smoothed over three letters' widths; 95 % of
                                 ///< the windows keep it [mm]
  double skew_rad = 0;           ///< median direction, from right towards down
};

/// A baseline is where the ink of a line falls off at its lower side, strip by strip of 6 mm, followed along the line.
/// Letters with descenders move it by a few hundredths of a millimetre: that is the floor of this figure.
/// \param light  of the page, 0 to 1, NaN where it shows nothing
LineStraightness measure_lines(const Image<float>& light, double pixels_per_mm);

}  // namespace pagesweep
