// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/tile_times_internal.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>

namespace pagesweep {
namespace {

constexpr float hardly_significant = 4;

/// Whether no sample was exposed later than its frame.
bool is_even(BellSamples::Kind kind) {
  return kind != BellSamples::Kind::uneven && kind != BellSamples::Kind::clipped_uneven;
}

}  // namespace

TileTimes::TileTimes(const StripeWindows& windows, const BellTables& tables, const StripeWidths& widths,
                     const PixelJudge& judge, TimeMap& map)
    : windows_(windows),
      widths_(widths),
      judge_(judge),
      map_(map),
      alone_(windows, judge.profile, judge.noise),
      bells_(tables, judge.noise.sensor(), judge.profile.full_width_half_maximum()),
      reader_(windows, bells_, judge.profile.full_width_half_maximum()) {}

void TileTimes::estimate(int y, int left, int columns) {
  using enum BellSamples::Kind;
  alone_.read(y);
  log_widths_.resize(most_bells);
  for (int first = left; first < left + columns; first += most_bells) {
    gather(y, first, std::min(most_bells, left + columns - first));
    if (candidates_.empty()) continue;
    for (const BellSamples::Kind kind : {core, partial, uneven, clipped, clipped_uneven}) fit(kind, y);
    for (const Candidate& candidate : candidates_)
      if (candidate.samples.kind == too_uneven) set_time(map_, candidate.x, y, look_closely(candidate));
  }
}

void TileTimes::gather(int y, int left, int columns) {
  candidates_.clear();
  widths_.log_row(y, left, std::span(log_widths_).first(static_cast<std::size_t>(columns)));
  for (int k = 0; k < columns; ++k) {
    const int x = left + k;
    if (windows_.centre(x, y) == StripeWindows::none) {
      set_time(map_, x, y, {});
      continue;
    }
    Candidate& candidate = candidates_.emplace_back();
    candidate.x = x;
    candidate.may_be_noise = windows_.significance(x, y) < hardly_significant;
    reader_.read(x, y, log_widths_[static_cast<std::size_t>(k)], k, candidate.samples);
  }
}

void TileTimes::fit(BellSamples::Kind kind, int y) {
  bells_.clear();
  fitted_.clear();
  for (const Candidate& candidate : candidates_) {
    if (candidate.samples.kind != kind) continue;
    fitted_.push_back(&candidate);
    reader_.add_to(bells_, candidate.samples);
  }
  if (fitted_.empty()) return;
  bells_.fit(BellSamples::content_of(kind));
  judge_whole_bells(bells_.batch(), judge_, verdicts_);
  doubtful_.clear();
  for (std::size_t i = 0; i < fitted_.size(); ++i) {
    const Candidate& candidate = *fitted_[i];
    if (kind == BellSamples::Kind::core && candidate.samples.is_whole && verdicts_.is_told[i] != 0) {
      set_whole(candidate.x, y, i);
      continue;
    }
    const PlainBells::Fit bell = bells_[static_cast<int>(i)];
    auto time = time_of(candidate, bell);
    if (!time && !candidate.may_be_noise && bell.converged && is_even(kind) && candidate.samples.is_whole) {
      doubtful_.push_back({&candidate, bell});
      continue;
    }
    if (!time) time = candidate.may_be_noise ? PixelTime{} : look_closely(candidate, &bell);
    set_time(map_, candidate.x, y, *time);
  }
  ask_for_second_opinions(y);
}

/// Puts what the fit says into the map.
void TileTimes::set_whole(int x, int y, std::size_t i) {
  const BellBatch& bells = bells_.batch();
  const bool ok = verdicts_.is_dark[i] == 0;
  map_.status(x, y) = ok ? PixelStatus::ok : PixelStatus::too_dark;
  map_.amplitude(x, y) = bells.amplitude[i];
  map_.residual(x, y) = verdicts_.residual[i];
  map_.time(x, y) = ok ? static_cast<float>(bells_.centre(i)) + bells.time[i] : not_a_number;
  map_.sigma(x, y) = ok ? bells.sigma[i] : not_a_number;
}

void TileTimes::ask_for_second_opinions(int y) {
  if (doubtful_.empty()) return;
  bells_.clear();
  for (const Doubtful& doubtful : doubtful_) {
    reader_.add_to(bells_, doubtful.candidate->samples);
    bells_.start_at(doubtful.bell);
  }
  bells_.fit_on_curved();
  for (std::size_t i = 0; i < doubtful_.size(); ++i) {
    const auto& [candidate, bell] = doubtful_[i];
    const BellSamples& samples = candidate->samples;
    const PlainBells::Fit second = bells_[static_cast<int>(i)];
    const auto place = [&](double time) { return place_of(samples, time); };
    set_time(map_, candidate->x, y, time_of_doubtful_bell(bell, second, place, width_of(samples), judge_));
  }
}

double TileTimes::width_of(const BellSamples& samples) {
  return static_cast<double>(samples.table->width * (1 + samples.log_width - samples.table->log_width));
}

std::optional<PixelTime> TileTimes::time_of(const Candidate& candidate, const PlainBells::Fit& bell) const {
  const BellSamples& samples = candidate.samples;
  const bool is_clipped = BellSamples::content_of(samples.kind) == Content::clipped;
  // Where a bell of which only the flanks are seen has gone, nobody knows.
  if (is_clipped && !bell.converged) return std::nullopt;
  const double width = width_of(samples);
  auto time = time_of_plain_bell(bell, width, judge_);
  if (time && time->status != PixelStatus::truncated && (is_clipped || !is_recorded(samples, time->bell_time, width)))
    time->status = judge_partial_bell(bell, time->sigma, place_of(samples, bell.time), width, judge_);
  return time;
}

PixelTime TileTimes::look_closely(const Candidate& candidate, const PlainBells::Fit* plain) {
  const double width = std::exp(static_cast<double>(candidate.samples.log_width));
  const auto window_around = [&](int frame) {
    PixelWindow window = alone_.window_at(candidate.x, width, frame);
    if (plain && plain->converged) window.start = {plain->amplitude, plain->background, plain->time, width};
    return window;
  };
  return time_by_likelihood_around(alone_.frame(candidate.x), window_around, judge_);
}

bool TileTimes::is_recorded(const BellSamples& samples, double time, double width) const {
  if (samples.is_whole) return true;
  const int begin = static_cast<int>(std::floor(time + width * judge_.profile.begin()));
  const int end = static_cast<int>(std::ceil(time + width * judge_.profile.end()));
  return windows_.are_present(begin, end - begin + 1);
}

BellPlace TileTimes::place_of(const BellSamples& samples, double time) const {
  const int frame = static_cast<int>(std::lround(time)), first = frame - samples.table->reach;
  const int row = BellTable::row_of(time - frame);
  return {samples.table,
          row,
          time - frame - BellTable::phase_of(row),
          first,
          windows_.present(first),
          samples.light + (first - samples.centre + windows_.half())};
}

}  // namespace pagesweep
