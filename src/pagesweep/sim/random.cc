// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/sim/random.h"

#include <algorithm>
#include <array>
#include <numbers>

namespace pagesweep::sim {
namespace {

/// Probability that a standard normal number exceeds z.
double upper_tail(double z) { return 0.5 * std::erfc(z * std::numbers::sqrt2 / 2); }

/// z >= 0 with upper_tail(z) = q, q <= 0.5. log upper_tail is concave, so Newton's steps from above never overshoot.
double upper_quantile(double q) {
  double z = std::sqrt(-2 * std::log(q));
  for (int i = 0; i < 50; ++i) {
    const double tail = upper_tail(z);
    const double density = std::exp(-0.5 * z * z) / std::sqrt(2 * std::numbers::pi);
    const double step = std::log(tail / q) * tail / density;
    z += step;
    if (std::abs(step) < 1e-13) break;
  }
  return z;
}

constexpr int cells = 8192;
constexpr int tail_cells = 48;  // beyond, the quantile bends too much for linear interpolation

std::array<float, cells + 1> make_quantiles() {
  std::array<float, cells + 1> quantiles{};
  for (int i = tail_cells; i <= cells - tail_cells; ++i)
    quantiles[static_cast<std::size_t>(i)] = static_cast<float>(inverse_normal(static_cast<double>(i) / cells));
  return quantiles;
}

}  // namespace

double inverse_normal(double p) { return p < 0.5 ? -upper_quantile(p) : upper_quantile(1 - p); }

double fast_inverse_normal(double p) {
  static const std::array<float, cells + 1> quantiles = make_quantiles();
  const double position = p * cells;
  const int cell = static_cast<int>(position);
  if (cell < tail_cells || cell >= cells - tail_cells) return inverse_normal(p);
  const auto i = static_cast<std::size_t>(cell);
  return quantiles[i] + (position - cell) * (quantiles[i + 1] - quantiles[i]);
}

double poisson(double mean, double p) {
  if (mean >= 30) {
    const double z = fast_inverse_normal(p);
    return std::max(0.0, std::floor(mean + std::sqrt(mean) * z + (z * z - 1) / 6 + 0.5));
  }
  double count = 0, probability = std::exp(-mean), below = probability;
  while (p > below && count < 200) {
    ++count;
    probability *= mean / count;
    below += probability;
  }
  return count;
}

}  // namespace pagesweep::sim
