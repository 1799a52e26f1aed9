// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "pagesweep/timing/plain_bells_internal.h"
#include "pagesweep/timing/sample_scans_internal.h"
#include "pagesweep/timing/stripe_width.h"

namespace pagesweep {

PlainBells::PlainBells(const BellTables& tables, const SensorNoise& noise, double fwhm)
    : tables_(tables),
      margin_(static_cast<int>(std::ceil(0.25 * fwhm)) + 1),  // the search finds it nearer than that
      most_late_(0.07 * fwhm),                                // Taylor's third order: 1e-3 of the height
      core_(static_cast<float>(core_widths * fwhm)) {
  batch_.middle = tables.longest_reach() + margin_;
  batch_.near = static_cast<float>(0.05 * fwhm);
  batch_.curvature = static_cast<float>(0.01 * fwhm);
  batch_.longest_step = static_cast<float>(0.3 * fwhm);
  batch_.read_variance = static_cast<float>(noise.read_variance);
  batch_.gain = static_cast<float>(noise.gain);
  batch_.ceiling = static_cast<float>(noise.ceiling);
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
  batch_.time[i] = 0;
}

void PlainBells::start_at(const Fit& fit) {
  const std::size_t i = last();
  batch_.time[i] = batch_.core_time[i] = static_cast<float>(fit.time - centre_[i]);
  batch_.amplitude[i] = static_cast<float>(fit.amplitude);
  batch_.background[i] = static_cast<float>(fit.background);
  batch_.core[i] = core_ * batch_.table[i]->width * (1 + batch_.width_rest[i]);
}

void PlainBells::clear() {
  batch_.count = 0;
  batch_.good.fill(0);
}

void PlainBells::start(Content content) {
  is_on_curved_ = false;
  batch_.may_be_clipped = content == Content::clipped;
  // The lowest sample, as the background, gives the bell's feet too much weight.
  batch_.least_steps = content == Content::whole ? 1 : 2;
  batch_.left_to.fill(0);
  std::fill_n(batch_.good.begin(), batch_.count, 1.0F);
  batch_.most_moved = static_cast<float>(margin_);
  if (content == Content::whole) return approach(batch_);
  // A bell that the recording's end has cut, or a plateau, may be far from where it was expected. There are samples.
  int reach_here = 0;
  for (std::size_t i = 0; i < static_cast<std::size_t>(batch_.count); ++i)
    reach_here = std::max(reach_here, batch_.table[i]->reach);
  batch_.most_moved = static_cast<float>(batch_.middle - reach_here);
  for (std::size_t i = 0; i < static_cast<std::size_t>(batch_.count); ++i) start_from_extremes(i);
}

void PlainBells::fit(Content content) {
  start(content);
  refine(batch_);
}

void PlainBells::fit_widths(Content content) {
  start(content);
  batch_.most_moved = static_cast<float>(margin_);  // tables change on the way: there must be samples for the widest
  refine_widths(batch_);
}

void PlainBells::fit_on_curved() {
  is_on_curved_ = true;
  batch_.most_moved = static_cast<float>(margin_);
  batch_.may_be_clipped = true;
  std::fill_n(batch_.good.begin(), batch_.count, 1.0F);
  batch_.tilt.fill(0);
  batch_.bend.fill(0);
  refine_on_curved(batch_);
}

void PlainBells::start_from_extremes(std::size_t i) {
  const int around = reach(*batch_.table[i]), first = reach() - around;
  const auto [low, high, seen, clipped] =
      scan_samples(batch_.gray[i] + first, batch_.present[i] + first, 2 * around + 1);
  batch_.background[i] = low;
  batch_.good[i] = seen > 0 ? 1.0F : 0.0F;
  batch_.amplitude[i] = std::max(high - low, 1.0F);
  if (clipped == 0) return;
  // The longer the plateau, the higher the bell must be that was cut off there.
  const float cut_at = std::max(batch_.table[i]->height_over(clipped + 1), 0.02F);
  batch_.amplitude[i] = std::max(batch_.amplitude[i], (batch_.ceiling - low) / cut_at);
}

/// Those that are there and not clipped.
int PlainBells::count_samples(std::size_t i) const {
  const int reach = batch_.table[i]->reach, frame = batch_.middle + static_cast<int>(std::lround(batch_.time[i]));
  int first = frame - reach, last = frame + reach;
  if (is_on_curved_) {
    const float middle = static_cast<float>(batch_.middle) + batch_.core_time[i];
    first = std::max(first, static_cast<int>(std::ceil(middle - batch_.core[i])));
    last = std::min(last, static_cast<int>(std::floor(middle + batch_.core[i])));
  }
  return scan_samples(batch_.gray[i] + first, batch_.present[i] + first, last - first + 1).seen;
}

PlainBells::Fit PlainBells::operator[](int k) const {
  const auto i = static_cast<std::size_t>(k);
  const bool is_good = batch_.good[i] > 0;
  Fit fit{is_good,
          static_cast<double>(centre_[i]) + static_cast<double>(is_good ? batch_.time[i] : batch_.left_to[i]),
          batch_.amplitude[i],
          batch_.background[i],
          batch_.sigma[i],
          std::max(0.0F, batch_.chi_square[i]),
          count_samples(i),
          batch_.log_width[i],
          batch_.width_sigma[i]};
  if (is_on_curved_) {
    const auto core = static_cast<double>(batch_.core[i]);
    fit.slope = static_cast<double>(batch_.tilt[i]) / core;
    fit.curvature = static_cast<double>(batch_.bend[i]) / (core * core);
  }
  return fit;
}

}  // namespace pagesweep
