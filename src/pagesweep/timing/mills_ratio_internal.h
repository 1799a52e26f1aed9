// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace pagesweep {

/// phi(z) / Phi(z) of the standard normal distribution.
double inverse_mills_ratio(double z);

/// The same as a table for single precision: from the nearest entry on it is a straight line to 4e-5.
struct MillsRatio {
  static constexpr float lowest = -8, highest = 5, steps = 32;  ///< of z; entries a unit
  /// From z = lowest on to one entry beyond highest.
  static const float* inverse();
};

}  // namespace pagesweep
