// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string_view>

#include "pagesweep/base/enum_names.h"
#include "pagesweep/data/picture.h"
#include "pagesweep/dewarping/page_frame.h"
#include "pagesweep/dewarping/paper_view.h"

namespace pagesweep {

/// What a side of the page's outline rests on.
enum class OutlineEvidence {
  paper_edge,       ///< the paper's edge, seen in the scan against a darker table
  measured_extent,  ///< no edge is seen there: the end of what was measured and is shown by the scan
  gutter,           ///< the end of the surface at the book's gutter
  surface_end,      ///< not cropped: the end of the surface's grid
};

constexpr auto names_of(OutlineEvidence) {
  return std::array<std::string_view, 4>{"paper_edge", "measured_extent", "gutter", "surface_end"};
}

/// What the page's direction rests on.
enum class DeskewEvidence {
  paper_edges,  ///< the free edges seen in the scan
  text_lines,   ///< edges are missing or poor
  none,         ///< neither: the surface's own s and t
};

constexpr auto names_of(DeskewEvidence) { return std::array<std::string_view, 3>{"paper_edges", "text_lines", "none"}; }

struct OutlineOptions {
  bool deskew = true;    ///< turn the frame to the page's direction
  bool crop = true;      ///< end at the paper's edge; otherwise the frame is all of the surface's grid
  double margin_mm = 0;  ///< keep that much around the paper (negative: cut it off), but not at the gutter
};

/// Sides in the order of PageOutline::sides.
enum class PageSide { left, right, top, bottom };

constexpr auto names_of(PageSide) { return std::array<std::string_view, 4>{"left", "right", "top", "bottom"}; }

/// The paper's rectangle on a PageSurface and what it rests on.
struct PageOutline {
  PageFrame frame;
  std::array<OutlineEvidence, 4> sides{};  ///< left, right, top, bottom
  DeskewEvidence deskew = DeskewEvidence::none;
};

/// Where the paper ends on the surface, and how it is turned.
///
/// The scan is looked up through the surface every 0.5 mm, up to 8 mm beyond the grid. On each free side the paper is
/// bright and the table, which is what lies at the outer rim, darker; the first paper of every line across the edge
/// gives a point, and the outermost straight line through a fair share of them is the edge: fingers, torn corners,
/// printing and dark photos at the edge move points, but not the line. It is then located at the half height of
/// brightness profiles along the edge. The angle is the mean of the edges, weighted by their precision.
///
/// Without a darker table the measured extent (status ok) stands for the edge, and the text lines for the angle.
/// \throws Error no_result  if the scan shows no part of the surface
PageOutline find_page_outline(const PaperView& view, const Picture& scan, const OutlineOptions& options = {});

}  // namespace pagesweep
