// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/estimate_times.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "pagesweep/base/parallel.h"
#include "pagesweep/timing/learn_profile.h"
#include "pagesweep/timing/pixel_time.h"
#include "pagesweep/timing/row_windows.h"

namespace pagesweep {
namespace {

PixelTime estimate_pixel(RowWindows& row, int x, double width, const PixelJudge& judge, const TimingOptions& options) {
  // Fewer standard deviations than this and noise alone would be taken for stripes.
  constexpr double least_significance = 3.5;
  if (row.significance(x) < least_significance) return {};
  const PixelWindow window = row.window(x, width);
  switch (options.estimator) {
    case TimeEstimator::center_of_mass:
      return time_by_center_of_mass(window, judge);
    case TimeEstimator::pairwise:
    case TimeEstimator::profile:
      return time_by_shift(window, judge);
    case TimeEstimator::refined:
      break;
  }
  const PixelTime time = time_by_likelihood(window, judge);
  // A start value that was far off had the bell near its window's border: look once more, with the bell in the middle.
  const double moved = time.bell_time - window.start.time;
  if (std::abs(moved) <= 0.25 * judge.profile.full_width_half_maximum() + 1) return time;
  const int centre = static_cast<int>(std::lround(std::clamp(time.bell_time, 0.0, judge.frame_count - 1.0)));
  return time_by_likelihood(row.window_at(x, width, centre), judge);
}

void estimate_row(RowWindows& row, int y, const PixelJudge& judge, const StripeWidths& widths,
                  const TimingOptions& options, TimeMap& map) {
  row.read(y);
  for (int x = 0; x < map.width(); ++x) {
    const PixelTime time = estimate_pixel(row, x, widths.at(x, y), judge, options);
    map.status(x, y) = time.status;
    map.amplitude(x, y) = static_cast<float>(time.amplitude);
    map.residual(x, y) = static_cast<float>(time.residual);
    if (time.status != PixelStatus::ok) continue;
    map.time(x, y) = static_cast<float>(time.time);
    map.sigma(x, y) = static_cast<float>(time.sigma);
  }
}

}  // namespace

TimeMap estimate_times(const Frames& frames, const StripeProfile& profile, const SensorNoise& noise,
                       const StripeWidths& widths, const TimingOptions& options, Progress& progress) {
  SensorNoise seen = noise;
  if (options.use_saturated) seen.ceiling = std::numeric_limits<double>::infinity();
  const std::vector<double>& exposures = frames.sequence().exposures;
  const FrameNoise frame_noise(noise, exposures);
  const PixelJudge judge{profile,           FrameNoise(seen, exposures), frames.count(), options.min_amplitude,
                         options.max_sigma, !options.use_saturated};
  TimeMap map(frames.width(), frames.height());
  constexpr int rows_a_step = 64, rows_a_range = 4;
  for (int first = 0; first < frames.height(); first += rows_a_step) {
    const int rows = std::min(rows_a_step, frames.height() - first);
    parallel_ranges(rows, rows_a_range, [&](int begin, int end) {
      RowWindows row(frames, profile, frame_noise, options.use_saturated);
      for (int y = first + begin; y < first + end; ++y) estimate_row(row, y, judge, widths, options, map);
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
