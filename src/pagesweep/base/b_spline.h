// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <vector>

namespace pagesweep {

/// The four cubic B-splines that are not zero at some x, and their first two derivatives: spline first + k has
/// value[k].
struct BSplineRow {
  int first = 0;
  std::array<double, 4> value{}, slope{}, curvature{};
};

/// Cubic B-splines over break points (de Boor 1978); beyond the outermost breaks they go on as straight lines.
class CubicBSplines {
 public:
  /// \throws std::invalid_argument  unless there are at least two breaks, strictly increasing
  explicit CubicBSplines(std::vector<double> breaks);

  int size() const { return static_cast<int>(breaks_.size()) + 2; }
  double front() const { return breaks_.front(); }
  double back() const { return breaks_.back(); }
  const std::vector<double>& breaks() const { return breaks_; }
  BSplineRow at(double x) const;
  /// K with c' K c = integral of weight (sum_i c_i B_i'')^2.
  /// \param weights  one an interval between breaks
  Eigen::MatrixXd bending(std::span<const double> weights) const;

 private:
  BSplineRow inside(double x) const;
  std::vector<double> breaks_, knots_;
};

}  // namespace pagesweep
