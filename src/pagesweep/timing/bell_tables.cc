// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/bell_tables_internal.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstddef>

#include "pagesweep/base/parallel.h"
#include "pagesweep/timing/bell_batch_internal.h"
#include "pagesweep/timing/stripe_width.h"

namespace pagesweep {
namespace {

constexpr double step = 0.01;  // of log width
const int steps_to_widest = static_cast<int>(std::ceil(std::log(widest_stripe) / step));

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
  table.width = static_cast<float>(width);
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
    float flanks[2] = {};
    for (int k = 0; k < count; ++k) {
      const float slope = table.slope[first + static_cast<std::size_t>(k)];
      flanks[slope > 0 ? 0 : 1] += slope * slope;
    }
    table.rising.push_back(flanks[0]);
    table.falling.push_back(flanks[1]);
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

BellTables::BellTables(const StripeProfile& profile, double reach)
    : profile_(profile), reach_(reach), tables_(2 * steps_to_widest + 1) {}

std::size_t BellTables::index_of(double log_width) {
  const double place = log_width * (1 / step) + steps_to_widest;
  return static_cast<std::size_t>(std::clamp(place, 0.0, 2.0 * steps_to_widest) + 0.5);
}

void BellTables::cover(std::pair<double, double> widths) {
  const std::size_t first = index_of(std::log(widths.first)), last = index_of(std::log(widths.second));
  parallel_rows(static_cast<int>(last - first + 1), [&](int i) {
    const std::size_t k = first + static_cast<std::size_t>(i);
    if (tables_[k]) return;
    const double log_width = (static_cast<int>(k) - steps_to_widest) * step;
    tables_[k] = std::make_unique<const BellTable>(make_table(profile_, reach_, log_width));
  });
}

int BellTables::longest_reach() const { return static_cast<int>(std::ceil(reach_ * std::exp(steps_to_widest * step))); }

}  // namespace pagesweep
