// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <limits>
#include <span>
#include <vector>

namespace pagesweep {

/// What a set of signed errors looks like. All members but count and bias are of the errors' absolute values, in the
/// errors' unit, and NaN if there are none.
struct ErrorSummary {
  static constexpr double none = std::numeric_limits<double>::quiet_NaN();
  std::size_t count = 0;
  double bias = none;  ///< median of the signed errors
  double median = none;
  double rms = none;
  double p95 = none;   ///< 95 % of the errors are smaller
  double p99 = none;   ///< 99 %
  double p999 = none;  ///< 99.9 %
  double max = none;
};

/// Order of the errors does not matter to any figure but the last bits of rms.
/// \pre  all errors are finite
ErrorSummary summarise(std::vector<double> errors);

/// The value below which `share` (0 to 1) of the values lie, linearly interpolated between neighbours; NaN if there are
/// none. Reorders the values.
double quantile(std::vector<double>& values, double share);

/// quantile(values, 0.5) of a copy.
double median_of(std::vector<double> values);

/// Root of the mean square; NaN if there are none.
double rms_of(std::span<const double> values);

}  // namespace pagesweep
