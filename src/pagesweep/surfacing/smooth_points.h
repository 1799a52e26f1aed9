// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "pagesweep/base/progress.h"
#include "pagesweep/data/point_map.h"
#include "pagesweep/surfacing/local_fit.h"

namespace pagesweep {

/// The rig frame turned about z by angle_rad: p runs along the reading direction, q up the page, z up.
struct PlanFrame {
  double angle_rad = 0;

  Eigen::Vector3d plan_from_rig(const Eigen::Vector3d& rig) const;
  Eigen::Vector3d rig_from_plan(const Eigen::Vector3d& plan) const;
};

/// A measured point in plan coordinates.
struct PlanPoint {
  float p, q, z, sigma;  ///< [mm]
  float intensity;       ///< [gray values]
};

/// Points in the order of the cells of a grid (row by row), of each cell those on the surface first.
struct SortedPoints {
  std::vector<PlanPoint> points;
  std::vector<std::size_t> first;  ///< the points of cell k are [first[k], first[k + 1])

  std::span<PlanPoint> of(std::size_t cell) { return {points.data() + first[cell], first[cell + 1] - first[cell]}; }
  std::span<const PlanPoint> of(std::size_t cell) const {
    return {points.data() + first[cell], first[cell + 1] - first[cell]};
  }
};

/// Weighted mean and covariance of points; positions are against (p_mm, q_mm).
CellMean mean_of(std::span<const PlanPoint> points, double p_mm, double q_mm);

/// The measured surface as heights z(p, q) on a regular grid seen from above: cell (i, j) has its centre at
/// p = p0_mm + i cell_mm, q = q0_mm + j cell_mm. Row 0 is the lower end of the page.
struct HeightField {
  PlanFrame frame;
  double cell_mm = 1;
  double p0_mm = 0, q0_mm = 0;
  Image<CellMean> cells;          ///< the mean of each cell's points on the surface; count says how many they are
  SortedPoints sorted;            ///< all points within the grid
  Image<float> z;                 ///< [mm] locally fitted surface at the cell's centre; NaN where status is not ok
  Image<float> sigma;             ///< [mm] its standard deviation
  Image<float> slope_p, slope_q;  ///< dz/dp, dz/dq there
  Image<float> intensity;         ///< [gray values] mean amplitude of the stripe; NaN where no point is
  Image<PixelStatus> status;  ///< of z; where it is missing the most frequent reason of the pixels that see the place
  double noise_factor = 1;    ///< by how much the points scatter more than their sigma promises
  std::int64_t points = 0;    ///< with status ok, of all cameras
  std::int64_t outliers = 0;  ///< of these, points off the surface around them

  int columns() const { return z.width(); }
  int rows() const { return z.height(); }
  double p_of(double i) const { return p0_mm + i * cell_mm; }
  double q_of(double j) const { return q0_mm + j * cell_mm; }
  double i_of(double p_mm) const { return (p_mm - p0_mm) / cell_mm; }
  double j_of(double q_mm) const { return (q_mm - q0_mm) / cell_mm; }
  std::size_t index(int i, int j) const {
    return static_cast<std::size_t>(j) * static_cast<std::size_t>(columns()) + static_cast<std::size_t>(i);
  }
  /// The points of cell (i, j) that lie on the surface.
  std::span<const PlanPoint> surface_points(int i, int j) const {
    return sorted.of(index(i, j)).first(static_cast<std::size_t>(cells(i, j).count));
  }
};

struct SmoothingOptions {
  double radius_mm = 6;  ///< of the neighbourhood; its rim counts little, so this acts like a disc of 4 to 5 mm
  double cell_mm = 0;    ///< 0: about four points a cell, but not below 1 mm
  double reading_direction_rad = 0;  ///< of the page's rightward direction against rig x
};

/// Robust weighted local fits (paraboloids) through the points of all cameras.
///
/// Points count by 1/sigma^2. A point farther than five standard deviations (its own and the neighbourhood's scatter)
/// from a first robust fit is an outlier. Across an edge of the surface (gutter, fold) the neighbourhood shrinks or
/// becomes one-sided, so that the edge is not rounded.
/// \throws Error no_result  if there are fewer than 30 points
HeightField smooth_points(std::span<const PointMap> cameras, const SmoothingOptions& options = {},
                          Progress& progress = no_progress());

}  // namespace pagesweep
