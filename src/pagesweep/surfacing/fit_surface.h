// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "pagesweep/base/enum_names.h"
#include "pagesweep/base/progress.h"
#include "pagesweep/data/page_surface.h"
#include "pagesweep/data/point_map.h"

namespace pagesweep {

enum class SurfaceModel {
  automatic,    ///< cylinder, unless the measured sheet differs from it by more than noise explains
  cylinder,     ///< straight rulings along the spine, a cut profile that may change from edge to edge
  developable,  ///< the measured surface itself with its creases, laid flat with the least stretching
};
constexpr auto names_of(SurfaceModel) { return std::array<std::string_view, 3>{"auto", "cylinder", "developable"}; }

enum class Layout {
  automatic,  ///< a spread if there is a gutter, else a single page
  single,     ///< one page
  spread,     ///< two pages with a gutter between them
  items,      ///< several sheets lying apart, each its own page
};
constexpr auto names_of(Layout) { return std::array<std::string_view, 4>{"automatic", "single", "spread", "items"}; }

struct SurfaceOptions {
  SurfaceModel model = SurfaceModel::automatic;
  Layout layout = Layout::automatic;
  double smoothing = 1;
  double neighbourhood_mm = 6;
  double reading_direction_rad = 0;  ///< of the page's rightward direction against rig x, in the rig's xy plane
  bool straighten = true;            ///< a rectangular sheet without a gutter stands upright however it lies

  template <class Visitor>
  void describe(Visitor&& visit) {
    visit("surface", model, "",
          "cylinder: straight lines along the spine; developable: the measured surface itself with its creases; auto: "
          "whichever of them the points support");
    visit("layout", layout, "",
          "one page, two pages, several sheets lying apart, or one or two decided by whether there is a gutter");
    visit("smoothing", smoothing, "", "multiplies the stiffness of the cut profile that suits the noise");
    visit("neighbourhood", neighbourhood_mm, "mm", "radius within which points are averaged to follow dents");
    visit("reading-direction", reading_direction_rad, "rad",
          "direction of reading against the rig's x axis, seen from above");
  }
};

/// The page surfaces in the points of all cameras, from left to right (sheets lying apart: in reading order), and their
/// flattening: docs/derivations/surfacing.md.
///
/// Seen from above, with the reading direction to the right, the pages are not mirrored. A page ends at the gutter; on
/// its other sides the grid reaches 8 mm beyond the measured paper. (s, t) = (0, 0) is the upper left corner of the
/// measured paper.
/// \throws Error no_result          if there are too few points for a surface
/// \throws std::invalid_argument    if there is no camera or an option makes no sense
std::vector<PageSurface> fit_surface(std::span<const PointMap> cameras, const SurfaceOptions& options = {},
                                     Progress& progress = no_progress());

}  // namespace pagesweep
