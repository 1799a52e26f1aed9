// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>

namespace pagesweep {

/// A place at which paper seems to begin: `along` the side of the page, and `across` it, counted from outside the page
/// inwards [mm].
struct EdgePoint {
  double along_mm;
  double across_mm;
};

/// A straight edge: across = across_mm + slope (along - along_mm).
struct EdgeLine {
  double along_mm = 0;   ///< mean of the points that made it
  double across_mm = 0;  ///< there
  double slope = 0;
  double slope_sigma = 0;  ///< one standard deviation
  double share = 0;        ///< of the given points that lie on it

  double across_at(double along) const { return across_mm + slope * (along - along_mm); }
};

/// The page's edge among points of which many lie elsewhere: on fingers, photos that touch the edge, torn corners,
/// other edges. It is the outermost straight line on which a fair share of the points lie: within `tolerance_mm`, at
/// least `min_length_mm` of points `pitch_mm` apart, and at least 0.3 of what the best line has.
/// \param max_slope  how far the page may be turned
std::optional<EdgeLine> find_edge_line(std::span<const EdgePoint> points, double pitch_mm, double tolerance_mm,
                                       double min_length_mm, double max_slope);

/// Least squares through points near a line, with Tukey's weights: those far off on the scale of the others' scatter
/// have no say. Nothing with fewer than 8 points left.
std::optional<EdgeLine> refine_edge_line(std::span<const EdgePoint> points, const EdgeLine& start);

}  // namespace pagesweep
