// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "pagesweep/base/image.h"
#include "pagesweep/data/page.h"

namespace pagesweep {

/// By how much the light of each spot of a page is to be multiplied to look as if it lay level on the table.
struct LightGain {
  double pitch_mm = 1;                 ///< of the grid, which begins at the page's corner
  std::array<Image<float>, 3> values;  ///< red, green, blue
};

/// Multiplies the page's light, sample by sample through the picture's tone curve; between the grid's nodes the gain is
/// bilinear. What the scan does not show is left alone.
void apply_gain(const LightGain& gain, Page& page);

}  // namespace pagesweep
