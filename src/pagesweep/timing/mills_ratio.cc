// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "pagesweep/timing/mills_ratio_internal.h"

namespace pagesweep {
namespace {

constexpr auto entries = static_cast<std::size_t>((MillsRatio::highest - MillsRatio::lowest) * MillsRatio::steps) + 2;

std::array<float, entries> make_table() {
  std::array<float, entries> table;
  for (std::size_t k = 0; k < entries; ++k)
    table[k] = static_cast<float>(inverse_mills_ratio(static_cast<double>(MillsRatio::lowest) +
                                                      static_cast<double>(k) / static_cast<double>(MillsRatio::steps)));
  return table;
}

}  // namespace

double inverse_mills_ratio(double z) {
  if (z < -8) return -z - 1 / z;  // asymptotic, 2 % off at -8 where no sample of a sound fit is
  return std::exp(-0.5 * z * z) / std::sqrt(2 * std::numbers::pi) / (0.5 * std::erfc(-z / std::numbers::sqrt2));
}

const float* MillsRatio::inverse() {
  static const std::array<float, entries> table = make_table();
  return table.data();
}

}  // namespace pagesweep
