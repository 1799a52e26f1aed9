// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/sim/random.h"

#include <gtest/gtest.h>

namespace pagesweep::sim {
namespace {

TEST(InverseNormal, IsTheInverseOfTheCumulativeFunction) {
  for (const double p : {1e-12, 1e-6, 0.003, 0.02, 0.3, 0.5, 0.77, 0.98, 0.999999}) {
    const double z = inverse_normal(p);
    EXPECT_NEAR(0.5 * std::erfc(-z / std::sqrt(2.0)) / p, 1, 1e-9) << p;
    EXPECT_NEAR(fast_inverse_normal(p), z, 3e-5) << p;
  }
}

// Sums of 400,000 draws: 4 standard errors of mean and variance.
TEST(Poisson, HasItsMeanAsVariance) {
  const CounterRandom random(3, 4);
  const int draws = 400000;
  for (const double mean : {0.2, 3.0, 29.9, 30.1, 250.0, 9000.0}) {
    double sum = 0, squares = 0;
    for (int i = 0; i < draws; ++i) {
      const double count = poisson(mean, random.uniform(static_cast<std::uint64_t>(i)));
      sum += count;
      squares += (count - mean) * (count - mean);
    }
    EXPECT_NEAR(sum / draws, mean, 4 * std::sqrt(mean / draws)) << mean;
    // The variance of squares is mean + 2 mean^2; rounding to whole events adds at most 1/12.
    EXPECT_NEAR(squares / draws, mean, 4 * std::sqrt((mean + 2 * mean * mean) / draws) + 1.0 / 12) << mean;
  }
}

TEST(CounterRandom, DiffersBySeedAndStream) {
  EXPECT_NE(CounterRandom(1, 0).bits(5), CounterRandom(2, 0).bits(5));
  EXPECT_NE(CounterRandom(1, 0).bits(5), CounterRandom(1, 1).bits(5));
  EXPECT_EQ(CounterRandom(1, 1).bits(5), CounterRandom(1, 1).bits(5));
}

}  // namespace
}  // namespace pagesweep::sim
