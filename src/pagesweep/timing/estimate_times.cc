// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/estimate_times.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include "pagesweep/base/parallel.h"
#include "pagesweep/timing/learn_profile.h"
#include "pagesweep/timing/pixel_time_internal.h"
#include "pagesweep/timing/recorded_times_internal.h"
#include "pagesweep/timing/row_windows_internal.h"

namespace pagesweep {
namespace {

/// Estimates the time values of one camera from whole frames, piece by piece. One a thread.
class Estimator {
 public:
  static constexpr int columns_at_once = 256;  // whose samples stay in the cache

  Estimator(const Frames& frames, const FrameNoise& noise, const StripeWidths& widths, const PixelJudge& judge,
            const TimingOptions& options, TimeMap& map)
      : row_(frames, judge.profile, noise, options.use_saturated),
        widths_(widths),
        judge_(judge),
        options_(options),
        map_(map) {}

  /// The pixels left, left + 1, ... of a row.
  void estimate(int y, int left, int columns) {
    row_.read(y, left, columns);
    for (int x = left; x < left + columns; ++x) set_time(map_, x, y, estimate_pixel(x, widths_.at(x, y)));
  }

 private:
  PixelTime estimate_pixel(int x, double width) {
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

  RowWindows row_;
  const StripeWidths& widths_;
  const PixelJudge& judge_;
  const TimingOptions& options_;
  TimeMap& map_;
};

TimeMap estimate_from_whole_frames(const Frames& frames, const StripeProfile& profile, const SensorNoise& noise,
                                   const StripeWidths& widths, const TimingOptions& options) {
  SensorNoise seen = noise;
  if (options.use_saturated) seen.ceiling = std::numeric_limits<double>::infinity();
  const std::vector<double>& exposures = frames.sequence().exposures;
  const FrameNoise frame_noise(noise, exposures);
  const PixelJudge judge{profile,           FrameNoise(seen, exposures), frames.count(), options.min_amplitude,
                         options.max_sigma, !options.use_saturated};
  TimeMap map(frames.width(), frames.height());
  constexpr int rows_a_range = 16;
  parallel_ranges(frames.height(), rows_a_range, [&](int begin, int end) {
    Estimator estimator(frames, frame_noise, widths, judge, options, map);
    for (int y = begin; y < end; ++y)
      for (int left = 0; left < frames.width(); left += Estimator::columns_at_once)
        estimator.estimate(y, left, std::min(Estimator::columns_at_once, frames.width() - left));
  });
  return map;
}

/// Widths and times of one of the cameras whose stripe was learned.
void estimate_camera(const Frames& frames, const TimingOptions& options, std::size_t i, Timing& timing) {
  if (RecordedTimes::can_estimate(frames.sequence(), options)) {
    RecordedTimes times(frames.sequence(), timing.profile, timing.noise[i], options);
    times.finish(frames);
    timing.widths[i] = std::move(times.widths());
    timing.maps[i] = std::move(times.map());
    return;
  }
  if (!options.uniform_width) timing.widths[i] = measure_widths(frames, timing.profile, timing.noise[i]);
  timing.maps[i] = estimate_from_whole_frames(frames, timing.profile, timing.noise[i], timing.widths[i], options);
}

}  // namespace

TimeMap estimate_times(const Frames& frames, const StripeProfile& profile, const SensorNoise& noise,
                       const StripeWidths& widths, const TimingOptions& options) {
  if (!RecordedTimes::can_estimate(frames.sequence(), options))
    return estimate_from_whole_frames(frames, profile, noise, widths, options);
  RecordedTimes times(frames.sequence(), profile, noise, options, widths);
  times.finish(frames);
  return std::move(times.map());
}

Timing estimate_times(std::span<const Frames> cameras, const TimingOptions& options, Progress& progress) {
  if (cameras.empty()) throw std::invalid_argument("estimate_times: at least one camera is needed");
  progress.begin("learning the stripe's profile");
  LearnedStripe learned = learn_stripe(cameras);
  Timing timing{std::move(learned.profile), std::move(learned.noise), {}, {}};
  for (const Frames& frames : cameras)
    if (frames.dropped() > 0)
      progress.warn(
          fmt::format("{}: {} of {} frames were dropped", frames.sequence().camera, frames.dropped(), frames.count()));
  progress.begin("time values");
  timing.widths.resize(cameras.size());
  timing.maps.resize(cameras.size());
  // Side by side, so that no thread waits while one makes room for a camera's maps.
  parallel_rows(static_cast<int>(cameras.size()), [&](int camera) {
    const auto i = static_cast<std::size_t>(camera);
    estimate_camera(cameras[i], options, i, timing);
  });
  return timing;
}

}  // namespace pagesweep
