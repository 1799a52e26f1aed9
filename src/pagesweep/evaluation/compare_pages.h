// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>

#include "pagesweep/data/page.h"
#include "pagesweep/evaluation/statistics.h"

namespace pagesweep {

struct PageComparisonOptions {
  double grid_mm = 2;
  double line_spacing_mm = 8;
  double line_window_mm = 100;

  template <class Visitor>
  void describe(Visitor&& visit) {
    visit("page-grid", grid_mm, "mm", "distance of the page positions that are compared");
    visit("line-spacing", line_spacing_mm, "mm", "distance of the text lines whose straightness is judged");
    visit("line-window", line_window_mm, "mm", "length of text line over which the largest deviation is judged");
  }
};

/// A flat page as a scan map and its scale.
struct MappedPage {
  const ScanMap* map = nullptr;
  double pixels_per_mm = 0;
};

/// How true a dewarped page is. Errors are what remains after the best rotation and shift of the whole page, which no
/// reader sees; scale is part of the error.
struct PageErrors {
  ErrorSummary displacement;                 ///< [mm] length of the displacement of each page position (never negative)
  double rotation_rad = ErrorSummary::none;  ///< by which the page stands askew, clockwise
  Eigen::Vector2d shift_mm = Eigen::Vector2d::Zero();  ///< then: truth = result turned by -rotation_rad + shift_mm
  double scale_error = ErrorSummary::none;             ///< size of the page over its true size, minus 1
  double scale_error_x = ErrorSummary::none;           ///< the same along the text lines
  double scale_error_y = ErrorSummary::none;           ///< and across them
  double covered = 0;                                  ///< share of the true page's positions that are on the result

  ErrorSummary line_deviation;  ///< [mm] of the places on text lines from the straight line through their text line
  double line_deviation_in_window = ErrorSummary::none;  ///< [mm] largest deviation within any window of a text line

  double spacing_mm = 0;                 ///< of the grid below, which begins half a spacing inside the page
  Image<Eigen::Vector2f> displacements;  ///< [mm] right and down, on the true page; NaN: not on the result or hidden
};

/// For a grid of positions on the true page: looks up where in the scan each is imaged, finds the position on the
/// result that was taken from there, and compares the two in millimetres.
/// \throws std::invalid_argument  if a map is missing or a scale is not positive
PageErrors compare_pages(const MappedPage& result, const MappedPage& truth, const PageComparisonOptions& options = {});

}  // namespace pagesweep
