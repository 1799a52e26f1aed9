// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "pagesweep/evaluation/compare_times.h"

namespace pagesweep {

/// Points of one kind of pixel against the true surface.
struct PointsOfKind {
  ErrorSummary distance;                    ///< [mm] perpendicular to the true surface
  double claimed_rms = ErrorSummary::none;  ///< [mm] that the points' standard deviations predict
  double bound_rms = ErrorSummary::none;    ///< [mm] that the bounds of their time values predict

  double error_over_claim() const { return distance.rms / claimed_rms; }
  double error_over_bound() const { return distance.rms / bound_rms; }
};

/// Where points are less certain than elsewhere, and whether more so than they must. A printed area is what lies within
/// two pixels of an edge of print or of something dark. Pixels within two of a page's rim are in none of print and
/// blank: they see something else than the page as well.
struct KindComparison {
  PointsOfKind blank;         ///< bright paper away from print
  PointsOfKind print;         ///< printed areas
  PointsOfKind bright_print;  ///< of these, the bright pixels: between letters, at edges
  PointsOfKind near_gutter, elsewhere;
};

/// One camera's points with their times, and the distances that compare_points() found.
struct KindView {
  const Camera* camera = nullptr;
  const PointMap* points = nullptr;
  const TimeMap* times = nullptr;
  const TruePoints* truth = nullptr;
  const Image<float>* distances = nullptr;  ///< [mm]
};

/// \param gutter  [mm] places on it, a few millimetres apart; empty: there is none
/// \param bound   may be empty: not known
KindComparison compare_kinds(std::span<const KindView> views, std::span<const Eigen::Vector3f> gutter,
                             const TimeComparisonOptions& options, const BoundOfAmplitude& bound);

/// Share by which the amplitude changes from pixel to pixel; NaN beside pixels without one.
double relative_gradient(const Image<float>& amplitude, int x, int y);

}  // namespace pagesweep
