// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/base/image.h"
#include "pagesweep/data/time_map.h"

namespace pagesweep {

/// Where the light of each pixel of a camera came from: the middle of the spot of paper that it sees, weighted with how
/// much each part of it reflects, relative to the pixel's centre. NaN where that is not known.
struct SpotOffsets {
  SpotOffsets() = default;
  SpotOffsets(int width, int height) : dx(width, height, not_a_number), dy(width, height, not_a_number) {}
  int width() const { return dx.width(); }
  int height() const { return dx.height(); }

  Image<float> dx, dy;  ///< [px]
};

}  // namespace pagesweep
