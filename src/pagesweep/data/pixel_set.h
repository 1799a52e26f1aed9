// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "pagesweep/base/image.h"

namespace pagesweep {

/// Some of a camera's pixels: those that are not 0. A station that is given one works on these alone and leaves what
/// it has found for others as it is; so the way from times to points can follow the stripe.
using PixelSet = Image<std::uint8_t>;

/// \param set  null: all pixels
inline bool takes_part(const PixelSet* set, int x, int y) { return !set || (*set)(x, y) != 0; }

/// Whether any pixel of a row does.
inline bool any_takes_part(const PixelSet* set, int y) {
  if (!set) return true;
  std::uint8_t any = 0;
  for (const std::uint8_t pixel : set->row(y)) any |= pixel;
  return any != 0;
}

}  // namespace pagesweep
