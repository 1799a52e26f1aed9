// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "pagesweep/timing/plain_bells_internal.h"

namespace pagesweep {

PlainBells::PlainBells(const BellTables& tables, const SensorNoise& noise, double fwhm) : tables_(tables) {
  const int margin = static_cast<int>(std::ceil(0.25 * fwhm)) + 1;  // the search finds it nearer than that
  batch_.middle = tables.longest_reach() + margin;
  batch_.most_moved = static_cast<float>(margin);
  batch_.near = static_cast<float>(0.05 * fwhm);
  batch_.longest_step = static_cast<float>(0.3 * fwhm);
  batch_.read_variance = static_cast<float>(noise.read_variance);
  batch_.gain = static_cast<float>(noise.gain);
  row_length_ = static_cast<std::size_t>(2 * batch_.middle + 1 + most_bells);
  gray_.assign(row_length_ * most_bells, 0);
}

float* PlainBells::add(int centre, double log_width) {
  const auto i = static_cast<std::size_t>(batch_.count++);
  centre_[i] = centre;
  batch_.table[i] = &tables_.at(log_width);
  batch_.width_rest[i] = static_cast<float>(log_width) - batch_.table[i]->log_width;
  batch_.gray[i] = &gray_[i * row_length_];
  batch_.time[i] = 0;
  batch_.good[i] = true;
  return &gray_[i * row_length_];
}

void PlainBells::fit() {
  approach(batch_);
  refine(batch_);
}

PlainBells::Fit PlainBells::operator[](int k) const {
  const auto i = static_cast<std::size_t>(k);
  return {batch_.good[i],
          static_cast<double>(centre_[i]) + static_cast<double>(batch_.time[i]),
          batch_.amplitude[i],
          batch_.background[i],
          batch_.sigma[i],
          std::max(0.0F, batch_.chi_square[i]),
          2 * batch_.table[i]->reach + 1};
}

}  // namespace pagesweep
