// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

namespace pagesweep {

/// Weights of the four equidistant samples at -1, 0, 1, 2 for a position 0 <= x <= 1: the cubic through the samples at
/// 0 and 1 whose slopes there are the central differences (Catmull and Rom 1974). They sum to 1; parabolas are kept.
constexpr std::array<double, 4> catmull_rom_weights(double x) {
  return {x * (-0.5 + x * (1 - 0.5 * x)), 1 + x * x * (-2.5 + 1.5 * x), x * (0.5 + x * (2 - 1.5 * x)),
          x * x * (-0.5 + 0.5 * x)};
}

/// Their derivatives with respect to x.
constexpr std::array<double, 4> catmull_rom_slopes(double x) {
  return {-0.5 + x * (2 - 1.5 * x), x * (-5 + 4.5 * x), 0.5 + x * (4 - 4.5 * x), x * (-1 + 1.5 * x)};
}

}  // namespace pagesweep
