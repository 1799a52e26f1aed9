// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <string_view>
#include <vector>

#include "pagesweep/base/enum_names.h"
#include "pagesweep/sim/crumpled_sheet.h"
#include "pagesweep/sim/grid_mesh.h"

namespace pagesweep::sim {

/// The edge of a sheet from which its profile is counted.
enum class SheetEdge { left, right, top, bottom };
constexpr auto names_of(SheetEdge) { return std::array<std::string_view, 4>{"left", "right", "top", "bottom"}; }

/// The profile's inclination at an arc length from the anchored edge.
struct ProfileSlope {
  double at_mm = 0;
  double slope_rad = 0;  ///< the paper rises by sin(slope) a millimetre
};

/// A dent or bump: height exp(-(a^2 + b^2) / 2), a and b counted in radii along its two axes.
struct Dent {
  double s_mm = 0, t_mm = 0;
  double height_mm = 0;  ///< below 0: a dent
  double radius_s_mm = 10, radius_t_mm = 10;
  double turn_rad = 0;  ///< of its axes on the paper
};

enum class SheetCorner { top_left, top_right, bottom_left, bottom_right };
constexpr auto names_of(SheetCorner) {
  return std::array<std::string_view, 4>{"top-left", "top-right", "bottom-left", "bottom-right"};
}

/// A corner that rolls up: beyond a line across it, the paper bends to a cylinder about that line. Where the sheet is
/// plane there, it stays unstretched.
struct Curl {
  SheetCorner corner = SheetCorner::bottom_right;
  double length_mm = 30;  ///< of the paper that rolls, along the bisector
  double radius_mm = 40;
};

/// A corner that is missing, beyond a ragged line between two places on the edges.
struct Tear {
  SheetCorner corner = SheetCorner::bottom_right;
  double along_s_mm = 30, along_t_mm = 30;  ///< from the corner to where the line meets the edges
  /// Whether a spot is missing.
  bool takes(double s_mm, double t_mm, double width_mm, double height_mm) const;
};

/// How a sheet of paper lies. Without dents it is a developable surface: a cone, of which a cylinder is the one with
/// its apex far away. The anchored edge is a ruling, a straight level line; the apex lies on it.
struct SheetShape {
  double width_mm = 0;   ///< along s
  double height_mm = 0;  ///< along t
  SheetEdge anchor = SheetEdge::left;
  Eigen::Vector3d at_mm = Eigen::Vector3d::Zero();  ///< middle of the anchored edge
  double turn_rad = 0;                              ///< about the vertical through it; 0: s is rig x, t is rig -y
  double apex_mm = 1e6;  ///< distance of the apex from the edge's middle, upwards (left) on the page if positive
  std::vector<ProfileSlope> slopes;  ///< halfway down the anchored edge; between them a monotone cubic (PCHIP)
  std::vector<Dent> dents;
  std::vector<Curl> curls;
  std::vector<Tear> tears;
  /// In place of slopes, dents and curls: then at_mm is the middle of the flat sheet on the level of the lowest spot.
  Crumple crumple;
};

/// Paper coordinates: s to the reader's right, t down the page, as the pixels of the flat page (page_surface.h).
struct Sheet {
  GridMesh mesh;
  double largest_strain = 0;  ///< relative, of the mesh against the flat sheet
};

/// Bends a sheet without stretching it. Dents displace it along its normal; then the paper moves within the surface
/// until it is stretched as little as possible.
/// \param spacing_mm  of the mesh at most; finer where the profile bends by more than 2 degrees within it
Sheet bend_sheet(const SheetShape& shape, double spacing_mm);

}  // namespace pagesweep::sim
