// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>

namespace pagesweep::sim {

/// Random numbers that depend on nothing but their address (seed, stream, index), so that pixels may be computed in any
/// order and on any thread. The mixing function is the finaliser of SplitMix64 (Steele, Lea, Flood 2014).
class CounterRandom {
 public:
  CounterRandom(std::uint64_t seed, std::uint64_t stream) : key_(mix(mix(seed + step) ^ (stream * step))) {}

  std::uint64_t bits(std::uint64_t index) const { return mix(key_ + (index + 1) * step); }
  /// Uniform in the open interval (0, 1).
  double uniform(std::uint64_t index) const {
    return (static_cast<double>(bits(index) >> 12) + 0.5) * (1.0 / 4503599627370496.0);
  }

 private:
  static constexpr std::uint64_t step = 0x9E3779B97F4A7C15u;
  static std::uint64_t mix(std::uint64_t z) {
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
  }
  std::uint64_t key_;
};

/// Inverse of the standard normal distribution's cumulative function, within 1e-12.
/// \pre 0 < p < 1
double inverse_normal(double p);

/// Likewise within 3e-5, from a table: for noise by the hundred million.
double fast_inverse_normal(double p);

/// Number of events where `mean` are expected: exact below 30, above by the Cornish-Fisher expansion of the quantile to
/// second order, which keeps mean, variance and skewness.
/// \param p  uniform in (0, 1)
double poisson(double mean, double p);

}  // namespace pagesweep::sim
