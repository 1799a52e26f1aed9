// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>

#include "pagesweep/base/image.h"
#include "pagesweep/base/parallel.h"

namespace pagesweep {

/// An image of one value. All threads fill it: for large ones, most of the time goes into the system's finding and
/// clearing the memory when it is touched first.
template <class T>
Image<T> filled_image(int width, int height, T value) {
  constexpr int rows_together = 64;
  Image<T> image(width, height, unfilled);
  parallel_ranges(height, rows_together, [&](int begin, int end) {
    for (int y = begin; y < end; ++y) std::ranges::fill(image.row(y), value);
  });
  return image;
}

}  // namespace pagesweep
