// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/evaluation/statistics.h"

#include <gtest/gtest.h>

#include <cmath>

namespace pagesweep {
namespace {

TEST(Summarise, FiguresOfAKnownSet) {
  std::vector<double> errors;
  for (int i = -500; i <= 500; ++i) errors.push_back(2 + i / 100.0);  // evenly from -3 to 7
  const ErrorSummary summary = summarise(errors);
  EXPECT_EQ(summary.count, 1001u);
  EXPECT_NEAR(summary.bias, 2, 1e-12);
  EXPECT_NEAR(summary.max, 7, 1e-12);
  EXPECT_NEAR(summary.rms, std::sqrt(4 + 25.05 / 3),
              1e-12);  // the variance of n evenly spaced values is step^2 (n^2 - 1) / 12
  EXPECT_NEAR(summary.p95, 6.5, 0.01);
  EXPECT_NEAR(summary.median, 2.5, 0.01) << "half of the absolute values are below 2.5";
}

TEST(Summarise, OfNothingIsNothing) {
  const ErrorSummary summary = summarise({});
  EXPECT_EQ(summary.count, 0u);
  EXPECT_TRUE(std::isnan(summary.rms));
  EXPECT_TRUE(std::isnan(summary.max));
}

TEST(Quantile, InterpolatesBetweenNeighbours) {
  std::vector<double> values{4, 1, 3, 2};
  EXPECT_DOUBLE_EQ(quantile(values, 0.5), 2.5);
  EXPECT_DOUBLE_EQ(quantile(values, 0), 1);
  EXPECT_DOUBLE_EQ(quantile(values, 1), 4);
}

}  // namespace
}  // namespace pagesweep
