// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/surfacing/smooth_points.h"

namespace pagesweep {

/// Which cells of the field show paper: 1, and which table or nothing: 0.
///
/// Paper is bright; what is printed on it is dark but has bright paper within 10 mm, or lies within the paper, or goes
/// on at the paper's height on one side only (a photo that fills the page to its edge). Table is darker, lies lower or
/// frames the paper on two sides and more, or is a plane of its own well below the paper.
/// \param small_sheets  bright pieces count as sheets of paper down to a hundredth of the largest one's size, not a
/// tenth
Image<std::uint8_t> find_paper(const HeightField& field, bool small_sheets = false);

}  // namespace pagesweep
