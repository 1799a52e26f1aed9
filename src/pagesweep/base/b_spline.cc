// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/base/b_spline.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace pagesweep {

CubicBSplines::CubicBSplines(std::vector<double> breaks) : breaks_(std::move(breaks)) {
  if (breaks_.size() < 2 || std::ranges::adjacent_find(breaks_, std::greater_equal<>{}) != breaks_.end())
    throw std::invalid_argument("B-splines need at least two break points in increasing order");
  knots_.assign(3, breaks_.front());
  knots_.insert(knots_.end(), breaks_.begin(), breaks_.end());
  knots_.insert(knots_.end(), 3, breaks_.back());
}

BSplineRow CubicBSplines::inside(double x) const {
  const auto above = std::upper_bound(breaks_.begin() + 1, breaks_.end() - 1, x);
  const auto first = static_cast<std::size_t>(above - breaks_.begin() - 1);
  const double* t = knots_.data() + first;  // x lies in [t[3], t[4])
  // Cox-de Boor: order[k][j] is the spline of degree k that begins at t[3 - k + j].
  std::array<std::array<double, 4>, 4> order{};
  order[0][0] = 1;
  for (int k = 1; k < 4; ++k)
    for (int j = 0; j <= k; ++j) {
      const auto n = static_cast<std::size_t>(k), m = static_cast<std::size_t>(j);
      const double* s = t + 3 - k + j;
      if (j > 0) order[n][m] += (x - s[0]) / (s[k] - s[0]) * order[n - 1][m - 1];
      if (j < k) order[n][m] += (s[k + 1] - x) / (s[k + 1] - s[1]) * order[n - 1][m];
    }
  // The derivative of a spline of degree k is a difference of two of degree k - 1.
  const auto derivative = [&](int k, int j, const auto& lower) {
    const double* s = t + 3 - k + j;
    const double rise = j > 0 ? lower(j - 1) / (s[k] - s[0]) : 0;
    const double fall = j < k ? lower(j) / (s[k + 1] - s[1]) : 0;
    return k * (rise - fall);
  };
  const auto linear = [&](int j) { return order[1][static_cast<std::size_t>(j)]; };
  const auto quadratic = [&](int j) { return order[2][static_cast<std::size_t>(j)]; };
  const auto quadratic_slope = [&](int j) { return derivative(2, j, linear); };
  BSplineRow row;
  row.first = static_cast<int>(first);
  for (int j = 0; j < 4; ++j) {
    const auto m = static_cast<std::size_t>(j);
    row.value[m] = order[3][m];
    row.slope[m] = derivative(3, j, quadratic);
    row.curvature[m] = derivative(3, j, quadratic_slope);
  }
  return row;
}

BSplineRow CubicBSplines::at(double x) const {
  const double nearest = std::clamp(x, front(), back());
  BSplineRow row = inside(nearest);
  if (nearest == x) return row;
  for (std::size_t k = 0; k < 4; ++k) {
    row.value[k] += (x - nearest) * row.slope[k];
    row.curvature[k] = 0;
  }
  return row;
}

Eigen::MatrixXd CubicBSplines::bending(std::span<const double> weights) const {
  Eigen::MatrixXd k = Eigen::MatrixXd::Zero(size(), size());
  const double gauss = 0.5 / std::sqrt(3.0);  // two points integrate the product of two straight lines exactly
  for (std::size_t n = 0; n + 1 < breaks_.size(); ++n) {
    const double width = breaks_[n + 1] - breaks_[n];
    for (const double position : {0.5 - gauss, 0.5 + gauss}) {
      const BSplineRow row = inside(breaks_[n] + position * width);
      for (int a = 0; a < 4; ++a)
        for (int b = 0; b < 4; ++b)
          k(row.first + a, row.first + b) += 0.5 * width * weights[n] * row.curvature[static_cast<std::size_t>(a)] *
                                             row.curvature[static_cast<std::size_t>(b)];
    }
  }
  return k;
}

}  // namespace pagesweep
