// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/evaluation/statistics.h"

#include <algorithm>
#include <cmath>

namespace pagesweep {

double quantile(std::vector<double>& values, double share) {
  if (values.empty()) return ErrorSummary::none;
  const double position = share * static_cast<double>(values.size() - 1);
  const auto below = static_cast<std::size_t>(position);
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(below);
  std::nth_element(values.begin(), at, values.end());
  if (below + 1 == values.size()) return *at;
  const double above = *std::min_element(at + 1, values.end());
  return *at + (position - static_cast<double>(below)) * (above - *at);
}

double median_of(std::vector<double> values) { return quantile(values, 0.5); }

double rms_of(std::span<const double> values) {
  if (values.empty()) return ErrorSummary::none;
  double squares = 0;
  for (const double value : values) squares += value * value;
  return std::sqrt(squares / static_cast<double>(values.size()));
}

ErrorSummary summarise(std::vector<double> errors) {
  ErrorSummary summary;
  summary.count = errors.size();
  if (errors.empty()) return summary;
  summary.rms = rms_of(errors);
  summary.bias = quantile(errors, 0.5);
  for (double& error : errors) error = std::abs(error);
  summary.median = quantile(errors, 0.5);
  summary.p95 = quantile(errors, 0.95);
  summary.p99 = quantile(errors, 0.99);
  summary.p999 = quantile(errors, 0.999);
  summary.max = *std::max_element(errors.begin(), errors.end());
  return summary;
}

}  // namespace pagesweep
