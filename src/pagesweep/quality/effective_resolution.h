// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/base/image.h"
#include "pagesweep/data/page.h"

namespace pagesweep {

/// At how many pixels an inch of paper the scan shows a page, place by place. Where that is less than the page's own
/// resolution, the page has more pixels than detail: near a steep gutter, seen at a slant.
struct ResolutionMap {
  double pitch_mm = 5;            ///< of the cells
  Image<float> across_dpi;        ///< along the text lines; NaN where the scan shows nothing
  Image<float> down_dpi;          ///< across the text lines
  double page_dpi = 0;            ///< what the page is written with
  double lowest_across_dpi = 0;   ///< that 95 % of the page exceed
  double lowest_down_dpi = 0;     ///< likewise
  double typical_across_dpi = 0;  ///< median
  double typical_down_dpi = 0;
};

/// From the scan map alone.
ResolutionMap map_resolution(const Page& page, double pitch_mm = 5);

}  // namespace pagesweep
