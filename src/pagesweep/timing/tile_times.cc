// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/tile_times_internal.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>

#include "pagesweep/timing/row_kernels_internal.h"

namespace pagesweep {
namespace {

constexpr float hardly_significant = 4;

}  // namespace

TileTimes::TileTimes(const StripeWindows& windows, const BellTables& tables, const StripeWidths& widths,
                     const PixelJudge& judge, TimeMap& map)
    : windows_(windows),
      widths_(widths),
      judge_(judge),
      map_(map),
      alone_(windows, judge.profile, judge.noise),
      bells_(tables, judge.noise.sensor(), judge.profile.full_width_half_maximum()),
      // What follows a pixel's samples is another's, or 0.
      light_(static_cast<std::size_t>(tile_pixels * windows.length() + most_bells)) {}

void TileTimes::estimate(int y, int left, int columns) {
  alone_.read(y);
  log_widths_.resize(tile_pixels);
  for (int first = left; first < left + columns; first += tile_pixels) {
    gather(y, first, std::min(tile_pixels, left + columns - first));
    if (candidates_.empty()) continue;
    for (const Sampling sampled : {Sampling::whole, Sampling::partial, Sampling::uneven}) fit(sampled, y);
    for (const Candidate& candidate : candidates_)
      if (sampling(candidate) == Sampling::too_uneven) set_time(map_, candidate.x, y, look_closely(candidate));
  }
}

void TileTimes::gather(int y, int left, int columns) {
  const Sequence& sequence = windows_.sequence();
  const auto black = static_cast<float>(sequence.black_level), saturation = static_cast<float>(sequence.saturation);
  const auto length = static_cast<std::size_t>(windows_.length());
  candidates_.clear();
  widths_.log_row(y, left, std::span(log_widths_).first(static_cast<std::size_t>(columns)));
  for (int k = 0; k < columns; ++k) {
    const int x = left + k, centre = windows_.centre(x, y);
    if (centre == StripeWindows::none) {
      set_time(map_, x, y, {});
      continue;
    }
    float* light = &light_[static_cast<std::size_t>(k) * length];
    const Candidate candidate{x, centre, log_widths_[static_cast<std::size_t>(k)],
                              windows_.significance(x, y) < hardly_significant, light};
    const float most = windows_.is_8_bit() ? take_off(windows_.gray<std::uint8_t>(x, y), length, black, light)
                                           : take_off(windows_.gray<std::uint16_t>(x, y), length, black, light);
    if (most >= saturation && is_clipped(candidate))
      set_time(map_, x, y, look_closely(candidate));
    else
      candidates_.push_back(candidate);
  }
}

bool TileTimes::is_clipped(const Candidate& candidate) const {
  const auto limit = static_cast<float>(windows_.sequence().saturation - windows_.sequence().black_level);
  const int reach = bells_.reach(candidate.log_width), first = windows_.half() - reach;
  const float* present = windows_.present(candidate.centre - reach);
  for (int k = 0; k <= 2 * reach; ++k)
    if (candidate.light[first + k] >= limit && present[k] > 0) return true;
  return false;
}

TileTimes::Sampling TileTimes::sampling(const Candidate& candidate) const {
  const int reach = bells_.reach(candidate.log_width), first = candidate.centre - reach, count = 2 * reach + 1;
  const bool is_whole = windows_.are_present(first, count);
  if (windows_.are_even(first, count)) return is_whole ? Sampling::whole : Sampling::partial;
  const std::span late(windows_.late(first), static_cast<std::size_t>(count));
  const bool is_plain =
      std::ranges::all_of(late, [most = bells_.most_late()](float frames) { return std::abs(frames) <= most; });
  return is_plain ? Sampling::uneven : Sampling::too_uneven;
}

void TileTimes::fit(Sampling sampled, int y) {
  bells_.clear();
  fitted_.clear();
  for (const Candidate& candidate : candidates_) {
    if (sampling(candidate) != sampled) continue;
    fitted_.push_back(candidate);
    const int first = candidate.centre - windows_.half();
    bells_.add(candidate.centre, candidate.log_width, candidate.light, windows_.present(first),
               sampled == Sampling::uneven ? windows_.late(first) : nullptr);
  }
  if (fitted_.empty()) return;
  sampled == Sampling::whole ? bells_.fit() : bells_.fit_partial();
  for (std::size_t i = 0; i < fitted_.size(); ++i) {
    const Candidate& candidate = fitted_[i];
    const PlainBells::Fit bell = bells_[static_cast<int>(i)];
    auto time = time_of_plain_bell(bell, std::exp(candidate.log_width), judge_);
    if (time && time->status != PixelStatus::truncated && sampled != Sampling::whole &&
        !is_recorded(*time, candidate.log_width))
      time->status = judge_partial(candidate, *time);
    if (!time) time = candidate.may_be_noise ? PixelTime{} : look_closely(candidate, &bell);
    set_time(map_, candidate.x, y, *time);
  }
}

PixelTime TileTimes::look_closely(const Candidate& candidate, const PlainBells::Fit* plain) {
  const double width = std::exp(candidate.log_width);
  const auto window_around = [&](int frame) {
    PixelWindow window = alone_.window_at(candidate.x, width, frame);
    if (plain && plain->converged) window.start = {plain->amplitude, plain->background, plain->time, width};
    return window;
  };
  return time_by_likelihood_around(alone_.frame(candidate.x), window_around, judge_);
}

bool TileTimes::is_recorded(const PixelTime& time, double log_width) const {
  const double width = std::exp(log_width);
  const int begin = static_cast<int>(std::floor(time.bell_time + width * judge_.profile.begin()));
  const int end = static_cast<int>(std::ceil(time.bell_time + width * judge_.profile.end()));
  return windows_.are_present(begin, end - begin + 1);
}

PixelStatus TileTimes::judge_partial(const Candidate& candidate, const PixelTime& time) {
  const int reach = bells_.reach(candidate.log_width), first = candidate.centre - windows_.half();
  const int begin = std::max(0, candidate.centre - reach);
  const int end = std::min(judge_.frame_count, candidate.centre + reach + 1);
  window_.clear();
  for (int i = begin; i < end; ++i)
    window_.push_back(*windows_.present(i) > 0 ? candidate.light[i - first] : not_a_number);
  const Bell bell{time.amplitude, time.background, time.bell_time, std::exp(candidate.log_width)};
  return judge_bell({window_, begin, bell}, bell, time.sigma, judge_);
}

}  // namespace pagesweep
