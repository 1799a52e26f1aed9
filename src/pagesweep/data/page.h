// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/base/filled_image.h"
#include "pagesweep/data/picture.h"
#include "pagesweep/data/status.h"
#include "pagesweep/data/time_map.h"

namespace pagesweep {

/// For each pixel of a flat page, the place in the scan where that spot of paper is imaged; NaN where hidden.
struct ScanMap {
  ScanMap() = default;
  ScanMap(int width, int height)
      : u(filled_image(width, height, not_a_number)), v(filled_image(width, height, not_a_number)) {}
  int width() const { return u.width(); }
  int height() const { return u.height(); }

  Image<float> u, v;  ///< [px] in the scan
};

/// A flat page, true to scale, and where each of its pixels came from.
struct Page {
  int index = 1;              ///< from left to right, 1 first
  Picture picture;            ///< picture.pixels_per_mm is its scale
  ScanMap scan_map;           ///< one entry a pixel of the picture
  double deskew_rad = 0;      ///< by how much the paper was turned to stand upright
  double measured_share = 1;  ///< of the page's area that rests on measured points rather than on the model alone
};

}  // namespace pagesweep
