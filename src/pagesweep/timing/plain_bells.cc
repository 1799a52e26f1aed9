// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>

#include "pagesweep/timing/plain_bells_internal.h"
#include "pagesweep/timing/stripe_width.h"

namespace pagesweep {

PlainBells::PlainBells(const BellTables& tables, const SensorNoise& noise, double fwhm)
    : tables_(tables),
      margin_(static_cast<int>(std::ceil(0.25 * fwhm)) + 1),  // the search finds it nearer than that
      most_late_(0.07 * fwhm) {                               // Taylor's third order: 1e-3 of the height
  batch_.middle = tables.longest_reach() + margin_;
  batch_.most_moved = static_cast<float>(margin_);
  batch_.near = static_cast<float>(0.05 * fwhm);
  batch_.curvature = static_cast<float>(0.01 * fwhm);
  batch_.longest_step = static_cast<float>(0.3 * fwhm);
  batch_.read_variance = static_cast<float>(noise.read_variance);
  batch_.gain = static_cast<float>(noise.gain);
  batch_.tables = &tables;
  batch_.width_prior = 1 / (0.2F * 0.2F);
  batch_.widest = static_cast<float>(std::log(widest_stripe));
}

void PlainBells::add(int centre, const BellTable& table, float log_width, const float* gray, const float* present,
                     const float* late) {
  const auto i = static_cast<std::size_t>(batch_.count++);
  centre_[i] = centre;
  batch_.table[i] = &table;
  batch_.log_width[i] = log_width;
  batch_.width_rest[i] = log_width - table.log_width;
  batch_.gray[i] = gray;
  batch_.present[i] = present;
  batch_.late[i] = late;
}

void PlainBells::clear() {
  batch_.count = 0;
  batch_.good.fill(0);
}

void PlainBells::start(bool partial) {
  batch_.time.fill(0);
  batch_.left_to.fill(0);
  std::fill_n(batch_.good.begin(), batch_.count, 1.0F);
  partial ? start_from_extremes() : approach(batch_);
}

void PlainBells::fit() {
  start(false);
  refine(batch_);
}

void PlainBells::fit_partial() {
  start(true);
  refine(batch_);
}

void PlainBells::fit_widths(bool partial) {
  start(partial);
  refine_widths(batch_);
}

void PlainBells::start_from_extremes() {
  for (std::size_t i = 0; i < static_cast<std::size_t>(batch_.count); ++i) {
    float low = std::numeric_limits<float>::infinity(), high = 0;
    const int around = reach(*batch_.table[i]);
    for (int k = reach() - around; k <= reach() + around; ++k) {
      if (batch_.present[i][k] == 0) continue;
      low = std::min(low, batch_.gray[i][k]);
      high = std::max(high, batch_.gray[i][k]);
    }
    batch_.background[i] = low;
    batch_.amplitude[i] = std::max(high - low, 1.0F);
    batch_.good[i] = std::isfinite(low) ? 1.0F : 0.0F;
  }
}

PlainBells::Fit PlainBells::operator[](int k) const {
  const auto i = static_cast<std::size_t>(k);
  const bool is_good = batch_.good[i] > 0;
  const int reach = batch_.table[i]->reach,
            first = batch_.middle + static_cast<int>(std::lround(batch_.time[i])) - reach;
  int samples = 0;
  for (int n = first; n <= first + 2 * reach; ++n) samples += batch_.present[i][n] > 0;
  return {is_good,
          static_cast<double>(centre_[i]) + static_cast<double>(is_good ? batch_.time[i] : batch_.left_to[i]),
          batch_.amplitude[i],
          batch_.background[i],
          batch_.sigma[i],
          std::max(0.0F, batch_.chi_square[i]),
          samples,
          batch_.log_width[i],
          batch_.width_sigma[i]};
}

}  // namespace pagesweep
