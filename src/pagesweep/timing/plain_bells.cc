// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>

#include "pagesweep/timing/plain_bells_internal.h"

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
}

void PlainBells::add(int centre, double log_width, const float* gray, const float* present, const float* late) {
  const auto i = static_cast<std::size_t>(batch_.count++);
  centre_[i] = centre;
  batch_.table[i] = &tables_.at(log_width);
  batch_.width_rest[i] = static_cast<float>(log_width) - batch_.table[i]->log_width;
  batch_.gray[i] = gray;
  batch_.present[i] = present;
  batch_.late[i] = late;
  batch_.time[i] = 0;
  batch_.good[i] = true;
  batch_.left_to[i] = 0;
}

void PlainBells::fit() {
  approach(batch_);
  refine(batch_);
}

void PlainBells::fit_partial() {
  for (std::size_t i = 0; i < static_cast<std::size_t>(batch_.count); ++i) {
    float low = std::numeric_limits<float>::infinity(), high = 0;
    const int around = batch_.table[i]->reach + margin_;
    for (int k = reach() - around; k <= reach() + around; ++k) {
      if (batch_.present[i][k] == 0) continue;
      low = std::min(low, batch_.gray[i][k]);
      high = std::max(high, batch_.gray[i][k]);
    }
    batch_.background[i] = low;
    batch_.amplitude[i] = std::max(high - low, 1.0F);
    batch_.good[i] = std::isfinite(low);
  }
  refine(batch_);
}

PlainBells::Fit PlainBells::operator[](int k) const {
  const auto i = static_cast<std::size_t>(k);
  const int reach = batch_.table[i]->reach,
            first = batch_.middle + static_cast<int>(std::lround(batch_.time[i])) - reach;
  const int samples =
      static_cast<int>(std::count(batch_.present[i] + first, batch_.present[i] + first + 2 * reach + 1, 1.0F));
  return {batch_.good[i],
          static_cast<double>(centre_[i]) + static_cast<double>(batch_.good[i] ? batch_.time[i] : batch_.left_to[i]),
          batch_.amplitude[i],
          batch_.background[i],
          batch_.sigma[i],
          std::max(0.0F, batch_.chi_square[i]),
          samples};
}

}  // namespace pagesweep
