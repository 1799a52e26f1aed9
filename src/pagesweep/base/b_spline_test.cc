// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/base/b_spline.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <stdexcept>

namespace pagesweep {
namespace {

const CubicBSplines splines({0, 1.5, 2, 5, 9, 10});

double sum(const std::array<double, 4>& values) { return std::accumulate(values.begin(), values.end(), 0.0); }

TEST(CubicBSplines, AddUpToOne) {
  for (double x = -3; x < 13; x += 0.37) {
    const BSplineRow row = splines.at(x);
    EXPECT_NEAR(sum(row.value), 1, 1e-14);
    EXPECT_NEAR(sum(row.slope), 0, 1e-13);
    EXPECT_NEAR(sum(row.curvature), 0, 1e-13);
    EXPECT_GE(row.first, 0);
    EXPECT_LE(row.first + 4, splines.size());
  }
}

/// Value, slope and curvature of the spline with coefficient k^2 - 3 k for its k-th part.
std::array<double, 3> evaluate(double x) {
  const BSplineRow row = splines.at(x);
  std::array<double, 3> result{};
  for (std::size_t k = 0; k < 4; ++k) {
    const double i = row.first + static_cast<double>(k), c = i * i - 3 * i;
    result[0] += c * row.value[k];
    result[1] += c * row.slope[k];
    result[2] += c * row.curvature[k];
  }
  return result;
}

TEST(CubicBSplines, DerivativesAgreeWithCentralDifferences) {
  const double h = 1e-5;
  for (double x = 0.02; x < 10; x += 0.173) {
    EXPECT_NEAR(evaluate(x)[1], (evaluate(x + h)[0] - evaluate(x - h)[0]) / (2 * h), 1e-7);
    EXPECT_NEAR(evaluate(x)[2], (evaluate(x + h)[1] - evaluate(x - h)[1]) / (2 * h), 1e-4);
  }
}

TEST(CubicBSplines, GoOnAsStraightLines) {
  const auto end = evaluate(10), beyond = evaluate(14);
  EXPECT_NEAR(beyond[0], end[0] + 4 * end[1], 1e-12);
  EXPECT_EQ(beyond[1], end[1]);
  EXPECT_EQ(beyond[2], 0);
}

TEST(CubicBSplines, BendingIsTheIntegralOfTheSquaredCurvature) {
  const std::vector<double> weights{1, 2, 1, 0.5, 3};
  const Eigen::MatrixXd k = splines.bending(weights);
  Eigen::VectorXd c(splines.size());
  for (int i = 0; i < c.size(); ++i) c(i) = i * i - 3 * i;
  double integral = 0;
  const int steps = 100000;
  for (int n = 0; n < steps; ++n) {
    const double x = 10 * (n + 0.5) / steps;
    const auto interval =
        std::upper_bound(splines.breaks().begin(), splines.breaks().end(), x) - splines.breaks().begin();
    integral += 10.0 / steps * weights[static_cast<std::size_t>(interval - 1)] * std::pow(evaluate(x)[2], 2);
  }
  EXPECT_NEAR(c.dot(k * c), integral, 1e-6 * integral);
}

TEST(CubicBSplines, RefuseBreaksThatDoNotIncrease) {
  EXPECT_THROW(CubicBSplines({1}), std::invalid_argument);
  EXPECT_THROW(CubicBSplines({0, 2, 2}), std::invalid_argument);
}

}  // namespace
}  // namespace pagesweep
