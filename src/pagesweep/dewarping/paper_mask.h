// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string_view>

#include "pagesweep/base/enum_names.h"
#include "pagesweep/data/page.h"
#include "pagesweep/data/picture.h"
#include "pagesweep/dewarping/page_frame.h"
#include "pagesweep/dewarping/paper_view.h"

namespace pagesweep {

/// What becomes of a finger, a clip or a slip of paper that lies on a page.
enum class Obstructions {
  keep,  ///< stays in the picture
  mask,  ///< is covered with ResampleOptions::fill
  fill,  ///< is covered with the colour of the paper around
};
constexpr auto names_of(Obstructions) { return std::array<std::string_view, 3>{"keep", "mask", "fill"}; }

/// What becomes of the table that shows beside crooked edges and in torn corners.
enum class Surroundings { keep, mask };
constexpr auto names_of(Surroundings) { return std::array<std::string_view, 2>{"keep", "mask"}; }

/// Which pixels of a page show something that stands above the paper: the surface says so (PixelStatus::covered). A rim
/// of `rim_mm` around it, within which no node of the surface lies, is taken with it, and so is its shadow, up to 6 mm
/// beyond. Empty if nothing stands above the paper.
/// \param picture  of the page, at its own scale
Image<char> find_obstructions(const PageSurface& surface, const PageFrame& frame, const Picture& picture,
                              double rim_mm = 1.5);

/// Which pixels of a page show no paper: what is darker than half-way between paper and table, where the surface has no
/// measured paper either (at the rim of that: nearly as dark as the table), and connected with the page's border. Empty
/// if the table is not darker than paper.
Image<char> find_surroundings(const PaperView& view, const Picture& scan, const PageFrame& frame, const Page& page);

/// Covers pixels with one brightness (a share of white). They are no longer the scan's: their places in the scan map
/// become NaN.
void cover_with(const Image<char>& mask, double brightness, Page& page);

/// Covers pixels with the colour of blank paper around them, which changes over the page as light does. Likewise.
void cover_with_paper(const Image<char>& mask, Page& page);

}  // namespace pagesweep
