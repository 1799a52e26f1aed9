// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/bell_tables_internal.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstddef>

#include "pagesweep/timing/bell_batch_internal.h"

namespace pagesweep {
namespace {

constexpr double step = 0.01;  // of log width

/// Least squares for gray = amplitude value + background + x slope, all samples alike: a row of weights an unknown.
Eigen::MatrixXf solution_weights(const float* value, const float* slope, int count) {
  Eigen::MatrixXd design(count, 3);
  for (int k = 0; k < count; ++k) design.row(k) << value[k], 1, slope[k];
  const Eigen::Matrix3d normal = design.transpose() * design;
  return (normal.inverse() * design.transpose()).cast<float>();
}

BellTable make_table(const StripeProfile& profile, double reach, double log_width) {
  const double width = std::exp(log_width);
  BellTable table;
  table.log_width = static_cast<float>(log_width);
  table.reach = static_cast<int>(std::ceil(reach * width));
  const int count = 2 * table.reach + 1;
  table.length = (count + most_bells - 1) / most_bells * most_bells;
  const auto length = static_cast<std::size_t>(table.length);
  for (auto* rows :
       {&table.value, &table.slope, &table.amplitude_weight, &table.background_weight, &table.slope_weight})
    rows->assign((BellTable::phases + 1) * length, 0);
  table.inside.assign(length, 0);
  std::fill_n(table.inside.begin(), count, 1.0f);
  for (int row = 0; row <= BellTable::phases; ++row) {
    const std::size_t first = static_cast<std::size_t>(row) * length;
    for (int k = 0; k < count; ++k) {
      const auto [value, slope] = profile.at((k - table.reach - BellTable::phase_of(row)) / width);
      table.value[first + static_cast<std::size_t>(k)] = static_cast<float>(value);
      table.slope[first + static_cast<std::size_t>(k)] = static_cast<float>(slope / width);
    }
    const Eigen::MatrixXf weights = solution_weights(&table.value[first], &table.slope[first], count);
    for (int k = 0; k < count; ++k) {
      table.amplitude_weight[first + static_cast<std::size_t>(k)] = weights(0, k);
      table.background_weight[first + static_cast<std::size_t>(k)] = weights(1, k);
      table.slope_weight[first + static_cast<std::size_t>(k)] = weights(2, k);
    }
  }
  return table;
}

}  // namespace

BellTables::BellTables(const StripeProfile& profile, double reach, std::pair<double, double> widths)
    : first_log_width_(step * std::floor(std::log(widths.first) / step)) {
  const int last = static_cast<int>(std::ceil((std::log(widths.second) - first_log_width_) / step));
  for (int i = 0; i <= std::max(0, last); ++i)
    tables_.push_back(make_table(profile, reach, first_log_width_ + i * step));
}

const BellTable& BellTables::at(double log_width) const {
  const auto last = static_cast<double>(tables_.size() - 1);
  return tables_[static_cast<std::size_t>(std::clamp((log_width - first_log_width_) / step + 0.5, 0.0, last))];
}

}  // namespace pagesweep
