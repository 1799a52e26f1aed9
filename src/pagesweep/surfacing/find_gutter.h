// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "pagesweep/surfacing/smooth_points.h"

namespace pagesweep {

/// The crease between the two pages of an open book, seen from above: p = p_mm + slope (q - q_mm).
struct Gutter {
  double p_mm = 0, q_mm = 0;
  double slope = 0;     ///< dp / dq
  double kink_rad = 0;  ///< by how much the paper turns there; median
  double share = 0;     ///< of the paper's height over which it was seen
};

/// Finds the gutter by its form: a straight deep valley up the page, near the middle of the paper. Brightness plays no
/// part.
/// \param certain  it is known that there is one: a shallow valley will do
/// \return         nothing if there is none
std::optional<Gutter> find_gutter(const HeightField& field, const Image<std::uint8_t>& paper, bool certain = false);

}  // namespace pagesweep
