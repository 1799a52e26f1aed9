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
#include "pagesweep/timing/plain_rows_internal.h"
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
    if (tables) plain_.emplace(frames, *tables, widths, judge);
  }

  /// The pixels left, left + 1, ... of a row.
  void estimate(int y, int left, int columns) {
    constexpr std::size_t many = 32;  // pixels: it pays to read what lies between them too
    alone_.clear();
    if (plain_) {
      plain_->estimate(y, left, columns, [&](int x, const PixelTime& time) { put(x, y, time); }, alone_);
    } else {
      for (int x = left; x < left + columns; ++x) alone_.push_back(x);
    }
    if (alone_.size() >= many) row_.read(y, left, columns);
    for (const int x : alone_) {
      if (alone_.size() < many) row_.read(y, x, 1);
      put(x, y, estimate_alone(x, widths_.at(x, y)));
    }
  }

 private:
  PixelTime estimate_alone(int x, double width) {
    // Fewer standard deviations than this and noise alone would be taken for stripes.
    constexpr double least_significance = 3.5;
    if (row_.significance(x) < least_significance) return {};
    switch (options_.estimator) {
      case TimeEstimator::center_of_mass:
        return time_by_center_of_mass(row_.window(x, width), judge_);
      case TimeEstimator::pairwise:
      case TimeEstimator::profile:
        return time_by_shift(row_.window(x, width), judge_);
      case TimeEstimator::refined:
        break;
    }
    return time_by_likelihood_around(row_.frame(x), [&](int frame) { return row_.window_at(x, width, frame); }, judge_);
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
  std::optional<PlainRows> plain_;
  std::vector<int> alone_;  ///< columns of the pixels that are no plain cases
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
  if (options.estimator == TimeEstimator::refined && !options.use_saturated && PlainRows::are_possible(frames))
    tables.emplace(profile, RowWindows::reach_around(profile), widths.range());
  TimeMap map(frames.width(), frames.height());
  constexpr int rows_a_step = 128, rows_a_range = 16;
  for (int first = 0; first < frames.height(); first += rows_a_step) {
    const int rows = std::min(rows_a_step, frames.height() - first);
    parallel_ranges(rows, rows_a_range, [&](int begin, int end) {
      Estimator estimator(frames, frame_noise, widths, tables ? &*tables : nullptr, judge, options, map);
      for (int y = first + begin; y < first + end; ++y)
        for (int left = 0; left < frames.width(); left += Estimator::columns_at_once)
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
