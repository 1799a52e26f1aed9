// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "pagesweep/data/time_map.h"
#include "pagesweep/timing/plain_rows_internal.h"
#include "pagesweep/timing/row_kernels_internal.h"

namespace pagesweep {
namespace {

int rounded_up(int value, int unit) { return (value + unit - 1) / unit * unit; }

}  // namespace

bool PlainRows::are_possible(const Frames& frames) { return frames.width() >= tile_pixels && are_uniform(frames); }

PlainRows::PlainRows(const Frames& frames, const BellTables& tables, const StripeWidths& widths,
                     const PixelJudge& judge)
    : frames_(frames),
      widths_(widths),
      judge_(judge),
      search_(frames.count(), judge.profile.full_width_half_maximum(), judge.noise.sensor().read_variance),
      bells_(tables, judge.noise.sensor(), judge.profile.full_width_half_maximum()),
      tile_frames_(rounded_up(2 * bells_.reach() + 1 + 32, tile_pixels)),
      pad_(tile_frames_ + most_bells) {
  for (int i = -pad_; i < frames.count() + pad_; ++i)
    present_.push_back(i >= 0 && i < frames.count() && frames.has(i) ? 1.0F : 0.0F);
  absent_before_.push_back(0);
  for (const float here : present_) absent_before_.push_back(absent_before_.back() + (here == 0 ? 1 : 0));
  // What follows a pixel's samples is another's, or 0.
  tile_.assign(static_cast<std::size_t>((tile_pixels + 1) * tile_frames_), 0);
}

void PlainRows::estimate(int y, int left, int columns, const std::function<void(int, const PixelTime&)>& put,
                         std::vector<int>& alone) {
  // Half a sigma less than a bell needs to be told from noise: between two blocks the response is that much lower.
  constexpr double least_significance = 3, hardly_significant = 4;
  if (y != row_y_) row_ = raw_row(frames_, y, pad_);
  row_y_ = y;
  search_.find(row_, pad_, left, columns);
  log_widths_.resize(static_cast<std::size_t>(columns));
  widths_.log_row(y, left, log_widths_);
  for (int first = 0; first < columns; first += tile_pixels) {
    candidates_.clear();
    for (int k = first; k < std::min(first + tile_pixels, columns); ++k) {
      if (search_.significance(k) < least_significance)
        put(left + k, {});
      else
        candidates_.push_back({left + k, search_.frame(k), log_widths_[static_cast<std::size_t>(k)],
                               search_.significance(k) < hardly_significant});
    }
    if (!candidates_.empty()) estimate_tile(std::min(left + first, frames_.width() - tile_pixels), put, alone);
  }
}

int PlainRows::gather_in_time(const std::function<void(int, const PixelTime&)>& put) {
  const auto middle = candidates_.begin() + static_cast<std::ptrdiff_t>(candidates_.size() / 2);
  std::ranges::nth_element(candidates_, middle, {}, &Candidate::centre);
  const int spare = tile_frames_ - (2 * bells_.reach() + 1);
  const int first_centre = middle->centre - spare / 2;
  std::erase_if(candidates_, [&](const Candidate& candidate) {
    const bool is_far = candidate.centre < first_centre || candidate.centre > first_centre + spare;
    if (is_far) put(candidate.x, look_closely(candidate));
    return is_far;
  });
  return first_centre - bells_.reach();
}

void PlainRows::estimate_tile(int tile_left, const std::function<void(int, const PixelTime&)>& put,
                              std::vector<int>& alone) {
  const int first = gather_in_time(put);
  const Sequence& sequence = frames_.sequence();
  std::array<float, tile_pixels> most;
  std::visit(
      [&](const auto& rows) {
        const auto used =
            std::span(rows).subspan(static_cast<std::size_t>(pad_ + first), static_cast<std::size_t>(tile_frames_));
        transpose_rows(used, tile_left, static_cast<float>(sequence.black_level), tile_.data(),
                       static_cast<std::size_t>(tile_frames_), most.data());
      },
      row_);
  std::erase_if(candidates_, [&](const Candidate& candidate) {
    const auto p = static_cast<std::size_t>(candidate.x - tile_left);
    if (most[p] < static_cast<float>(sequence.saturation)) return false;
    const float* gray =
        &tile_[p * static_cast<std::size_t>(tile_frames_)] + (candidate.centre - bells_.reach() - first);
    if (!is_clipped(candidate, gray)) return false;
    alone.push_back(candidate.x);
    return true;
  });
  for (const bool whole : {true, false}) fit(whole, tile_left, first, put);
}

bool PlainRows::is_clipped(const Candidate& candidate, const float* gray) const {
  const auto limit = static_cast<float>(frames_.sequence().saturation - frames_.sequence().black_level);
  const float* present = &present_[static_cast<std::size_t>(pad_ + candidate.centre - bells_.reach())];
  for (int k = 0; k <= 2 * bells_.reach(); ++k)
    if (gray[k] >= limit && present[k] > 0) return true;
  return false;
}

bool PlainRows::is_whole(int centre) const {
  const auto begin = static_cast<std::size_t>(pad_ + centre - bells_.reach());
  return absent_before_[begin] == absent_before_[begin + static_cast<std::size_t>(2 * bells_.reach() + 1)];
}

void PlainRows::fit(bool whole, int tile_left, int first, const std::function<void(int, const PixelTime&)>& put) {
  const auto gray_of = [&](const Candidate& candidate) {
    return &tile_[static_cast<std::size_t>((candidate.x - tile_left) * tile_frames_)] +
           (candidate.centre - bells_.reach() - first);
  };
  bells_.clear();
  fitted_.clear();
  for (const Candidate& candidate : candidates_) {
    if (is_whole(candidate.centre) != whole) continue;
    fitted_.push_back(candidate);
    bells_.add(candidate.centre, candidate.log_width, gray_of(candidate),
               &present_[static_cast<std::size_t>(pad_ + candidate.centre - bells_.reach())]);
  }
  if (fitted_.empty()) return;
  whole ? bells_.fit() : bells_.fit_partial();
  for (std::size_t i = 0; i < fitted_.size(); ++i) {
    const Candidate& candidate = fitted_[i];
    auto time = time_of_plain_bell(bells_[static_cast<int>(i)], std::exp(candidate.log_width), judge_);
    if (time && time->status != PixelStatus::truncated && !whole)
      time->status = judge_partial(candidate, *time, gray_of(candidate));
    put(candidate.x, time ? *time : candidate.may_be_noise ? PixelTime{} : look_closely(candidate));
  }
}

PixelTime PlainRows::look_closely(const Candidate& candidate) {
  return time_by_likelihood_around(
      candidate.centre, [&](int frame) { return window_around(candidate, frame); }, judge_);
}

PixelWindow PlainRows::window_around(const Candidate& candidate, int frame) {
  const double width = std::exp(candidate.log_width);
  const int reach = static_cast<int>(std::ceil(RowWindows::reach_around(judge_.profile) * width));
  const int begin = std::max(0, frame - reach), end = std::min(frames_.count(), frame + reach + 1);
  const double black = frames_.sequence().black_level, saturation = frames_.sequence().saturation;
  window_.clear();
  std::visit(
      [&](const auto& rows) {
        for (int i = begin; i < end; ++i) {
          const double gray = rows[static_cast<std::size_t>(pad_ + i)][candidate.x];
          const float seen =
              gray >= saturation ? std::numeric_limits<float>::infinity() : static_cast<float>(gray - black);
          window_.push_back(frames_.has(i) ? seen : not_a_number);
        }
      },
      row_);
  float low = std::numeric_limits<float>::infinity(), high = 0;
  for (const float gray : window_) {
    if (!std::isfinite(gray)) continue;
    low = std::min(low, gray);
    high = std::max(high, gray);
  }
  Bell start;
  start.background = std::isfinite(low) ? low : 0;
  start.amplitude = std::max(high - start.background, 1.0);
  start.time = frame;
  start.width = width;
  return {window_, begin, start};
}

PixelStatus PlainRows::judge_partial(const Candidate& candidate, const PixelTime& time, const float* gray) {
  const int reach = bells_.reach();
  const int begin = std::max(0, candidate.centre - reach);
  const int end = std::min(frames_.count(), candidate.centre + reach + 1);
  window_.clear();
  for (int i = begin; i < end; ++i)
    window_.push_back(frames_.has(i) ? gray[i - (candidate.centre - reach)] : not_a_number);
  const Bell bell{time.amplitude, time.background, time.bell_time, std::exp(candidate.log_width)};
  return judge_bell({window_, begin, bell}, bell, time.sigma, judge_);
}

}  // namespace pagesweep
