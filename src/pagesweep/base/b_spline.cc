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
  // Cox-de Boor: the splines of degree 1, 2 and 3 that are not zero at x, each a mixture of two of the degree below.
  const double w1 = 1 / (t[4] - t[3]);
  const double linear[2] = {w1 * (t[4] - x), w1 * (x - t[3])};
  const double w2[2] = {linear[0] / (t[4] - t[2]), linear[1] / (t[5] - t[3])};
  const double quadratic[3] = {w2[0] * (t[4] - x), w2[0] * (x - t[2]) + w2[1] * (t[5] - x), w2[1] * (x - t[3])};
  const double r3[3] = {1 / (t[4] - t[1]), 1 / (t[5] - t[2]), 1 / (t[6] - t[3])};
  const double w3[3] = {r3[0] * quadratic[0], r3[1] * quadratic[1], r3[2] * quadratic[2]};
  // The derivative of a spline of degree k is k times a difference of two of degree k - 1, over their widths.
  const double d3[3] = {r3[0] * -2 * w2[0], r3[1] * 2 * (w2[0] - w2[1]), r3[2] * 2 * w2[1]};
  BSplineRow row;
  row.first = static_cast<int>(first);
  row.value = {w3[0] * (t[4] - x), w3[0] * (x - t[1]) + w3[1] * (t[5] - x), w3[1] * (x - t[2]) + w3[2] * (t[6] - x),
               w3[2] * (x - t[3])};
  row.slope = {-3 * w3[0], 3 * (w3[0] - w3[1]), 3 * (w3[1] - w3[2]), 3 * w3[2]};
  row.curvature = {-3 * d3[0], 3 * (d3[0] - d3[1]), 3 * (d3[1] - d3[2]), 3 * d3[2]};
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
