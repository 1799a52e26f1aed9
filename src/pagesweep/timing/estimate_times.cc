// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/estimate_times.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <vector>

#include "pagesweep/base/parallel.h"
#include "pagesweep/timing/learn_profile.h"
#include "pagesweep/timing/pixel_time_internal.h"
#include "pagesweep/timing/row_windows_internal.h"

namespace pagesweep {
namespace {

/// Estimates the time values of one camera piece by piece. One a thread.
class Estimator {
 public:
  static constexpr int columns_at_once = 256;  // whose samples stay in the cache

  /// \param tables  for the plain cases; null: none is to be taken for one
  Estimator(const Frames& frames, const FrameNoise& noise, const StripeWidths& widths, const BellTables* tables,
            const PixelJudge& judge, const TimingOptions& options, TimeMap& map)
      : row_(frames, judge.profile, noise, options.use_saturated),
        widths_(widths),
        judge_(judge),
        options_(options),
        map_(map) {
    if (tables) plain_.emplace(*tables, noise.sensor(), judge.profile.full_width_half_maximum());
  }

  /// The pixels left, left + 1, ... of a row.
  void estimate(int y, int left, int columns) {
    // Fewer standard deviations than this and noise alone would be taken for stripes.
    constexpr double least_significance = 3.5;
    row_.read(y, left, columns);
    log_widths_.resize(static_cast<std::size_t>(columns));
    widths_.log_row(y, left, log_widths_);
    for (int x = left; x < left + columns; ++x) {
      const float log_width = log_widths_[static_cast<std::size_t>(x - left)];
      if (row_.significance(x) < least_significance)
        put(x, y, {});
      else if (!plain_ || !collect(x, log_width))
        put(x, y, estimate_alone(x, std::exp(log_width)));
      if (plain_ && plain_->is_full()) fit_collected(y, left);
    }
    if (plain_) fit_collected(y, left);
  }

 private:
  /// \return whether the pixel looks like a plain case
  bool collect(int x, double log_width) {
    const int centre = row_.frame(x), reach = plain_->reach();
    if (centre < reach || centre + reach >= row_.frame_count()) return false;
    float* gray = plain_->add(centre, log_width);
    if (!row_.copy(x, centre - reach, {gray, static_cast<std::size_t>(2 * reach + 1)})) {
      plain_->drop_last();
      return false;
    }
    collected_.push_back(x);
    return true;
  }

  void fit_collected(int y, int left) {
    plain_->fit();
    for (std::size_t i = 0; i < collected_.size(); ++i) {
      const int x = collected_[i];
      const double width = std::exp(log_widths_[static_cast<std::size_t>(x - left)]);
      const auto time = time_of_plain_bell((*plain_)[static_cast<int>(i)], width, judge_);
      put(x, y, time ? *time : estimate_alone(x, width));
    }
    collected_.clear();
    plain_->clear();
  }

  PixelTime estimate_alone(int x, double width) {
    const PixelWindow window = row_.window(x, width);
    switch (options_.estimator) {
      case TimeEstimator::center_of_mass:
        return time_by_center_of_mass(window, judge_);
      case TimeEstimator::pairwise:
      case TimeEstimator::profile:
        return time_by_shift(window, judge_);
      case TimeEstimator::refined:
        break;
    }
    const PixelTime time = time_by_likelihood(window, judge_);
    // A start value that was far off had the bell near its window's border: look once more, with the bell in the
    // middle.
    const double moved = time.bell_time - window.start.time;
    if (std::abs(moved) <= 0.25 * judge_.profile.full_width_half_maximum() + 1) return time;
    const int centre = static_cast<int>(std::lround(std::clamp(time.bell_time, 0.0, judge_.frame_count - 1.0)));
    return time_by_likelihood(row_.window_at(x, width, centre), judge_);
  }

  void put(int x, int y, const PixelTime& time) {
    map_.status(x, y) = time.status;
    map_.amplitude(x, y) = static_cast<float>(time.amplitude);
    map_.residual(x, y) = static_cast<float>(time.residual);
    if (time.status != PixelStatus::ok) return;
    map_.time(x, y) = static_cast<float>(time.time);
    map_.sigma(x, y) = static_cast<float>(time.sigma);
  }

  RowWindows row_;
  const StripeWidths& widths_;
  const PixelJudge& judge_;
  const TimingOptions& options_;
  TimeMap& map_;
  std::optional<PlainBells> plain_;
  std::vector<float> log_widths_;
  std::vector<int> collected_;  ///< columns of the pixels in plain_
};

}  // namespace

TimeMap estimate_times(const Frames& frames, const StripeProfile& profile, const SensorNoise& noise,
                       const StripeWidths& widths, const TimingOptions& options, Progress& progress) {
  SensorNoise seen = noise;
  if (options.use_saturated) seen.ceiling = std::numeric_limits<double>::infinity();
  const std::vector<double>& exposures = frames.sequence().exposures;
  const FrameNoise frame_noise(noise, exposures);
  const PixelJudge judge{profile,           FrameNoise(seen, exposures), frames.count(), options.min_amplitude,
                         options.max_sigma, !options.use_saturated};
  std::optional<BellTables> tables;
  if (options.estimator == TimeEstimator::refined && !options.use_saturated && frame_noise.mean_weight() == 1)
    tables.emplace(profile, RowWindows::reach_around(profile), widths.range());
  TimeMap map(frames.width(), frames.height());
  constexpr int rows_a_step = 128, rows_a_range = 16;
  for (int first = 0; first < frames.height(); first += rows_a_step) {
    const int rows = std::min(rows_a_step, frames.height() - first);
    parallel_ranges(rows, rows_a_range, [&](int begin, int end) {
      Estimator estimator(frames, frame_noise, widths, tables ? &*tables : nullptr, judge, options, map);
      for (int left = 0; left < frames.width(); left += Estimator::columns_at_once)
        for (int y = first + begin; y < first + end; ++y)
          estimator.estimate(y, left, std::min(Estimator::columns_at_once, frames.width() - left));
    });
    progress.advance(static_cast<double>(first + rows) / frames.height());
  }
  return map;
}

Timing estimate_times(std::span<const Frames> cameras, const TimingOptions& options, Progress& progress) {
  if (cameras.empty()) throw std::invalid_argument("estimate_times: at least one camera is needed");
  progress.begin("learning the stripe's profile");
  LearnedStripe learned = learn_stripe(cameras);
  Timing timing{std::move(learned.profile), std::move(learned.noise), {}, {}};
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    progress.begin(fmt::format("time values of {}", cameras[i].sequence().camera));
    if (cameras[i].dropped() > 0)
      progress.warn(fmt::format("{}: {} of {} frames were dropped", cameras[i].sequence().camera, cameras[i].dropped(),
                                cameras[i].count()));
    timing.widths.push_back(options.uniform_width ? StripeWidths()
                                                  : measure_widths(cameras[i], timing.profile, timing.noise[i]));
    timing.maps.push_back(
        estimate_times(cameras[i], timing.profile, timing.noise[i], timing.widths[i], options, progress));
  }
  return timing;
}

}  // namespace pagesweep
