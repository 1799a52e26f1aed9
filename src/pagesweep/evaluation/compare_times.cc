// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/evaluation/compare_times.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "pagesweep/base/parallel.h"
#include "pagesweep/evaluation/compare_kinds.h"

namespace pagesweep {
namespace {

/// Errors with what the time values claim, gathered for one kind of pixel.
struct Tally {
  std::vector<double> errors, claims, bounds, normalised;

  void add(double error, double claim, double bound) {
    errors.push_back(error);
    if (claim > 0 && std::isfinite(claim)) {
      claims.push_back(claim);
      normalised.push_back(error / claim);
    }
    if (bound > 0 && std::isfinite(bound)) bounds.push_back(bound);
  }
  TimeErrors summary() const { return {summarise(errors), rms_of(claims), rms_of(bounds), rms_of(normalised)}; }
};

/// Time value minus true time [frames], NaN where either is missing.
Image<float> errors_of(const TimedView& view, const Light& light) {
  const TimeMap& times = *view.times;
  Image<float> errors(times.width(), times.height(), not_a_number);
  parallel_rows(times.height(), [&](int y) {
    for (int x = 0; x < times.width(); ++x) {
      if (times.status(x, y) != PixelStatus::ok || !(*view.truth)(x, y).allFinite()) continue;
      if (const auto truth = light.time_of((*view.truth)(x, y).cast<double>()))
        errors(x, y) = static_cast<float>(times.time(x, y) - *truth);
    }
  });
  return errors;
}

double median_of_all(std::span<const Image<float>> maps) {
  std::vector<double> values;
  for (const Image<float>& map : maps)
    for (const float value : map.pixels())
      if (std::isfinite(value)) values.push_back(value);
  return quantile(values, 0.5);
}

void check(std::span<const TimedView> views) {
  for (const TimedView& view : views) {
    if (!view.times || !view.truth) throw std::invalid_argument("compare_times: a view needs times and true points");
    if (view.times->width() != view.truth->width() || view.times->height() != view.truth->height())
      throw std::invalid_argument("compare_times: times and true points differ in size");
  }
}

}  // namespace

TimeComparison compare_times(std::span<const TimedView> views, const Light& light, const TimeComparisonOptions& options,
                             const BoundOfAmplitude& bound) {
  check(views);
  TimeComparison comparison;
  for (const TimedView& view : views) comparison.error_maps.push_back(errors_of(view, light));
  comparison.offset_frames = median_of_all(comparison.error_maps);
  Tally all, bright, dark, blank, print_edges;
  for (std::size_t c = 0; c < views.size(); ++c) {
    const TimeMap& times = *views[c].times;
    Image<float>& errors = comparison.error_maps[c];
    Tally camera;
    for (int y = 0; y < times.height(); ++y)
      for (int x = 0; x < times.width(); ++x) {
        if (!std::isfinite(errors(x, y))) continue;
        const double error = errors(x, y) - comparison.offset_frames;
        const double claim = times.sigma(x, y), amplitude = times.amplitude(x, y);
        const double least = bound ? bound(amplitude) : ErrorSummary::none;
        errors(x, y) = static_cast<float>(error);
        all.add(error, claim, least);
        camera.add(error, claim, least);
        (amplitude > options.bright_amplitude ? bright : dark).add(error, claim, least);
        const double gradient = relative_gradient(times.amplitude, x, y);
        if (std::isfinite(gradient)) (gradient > options.print_edge ? print_edges : blank).add(error, claim, least);
      }
    comparison.cameras.push_back(camera.summary());
  }
  comparison.all = all.summary();
  comparison.bright = bright.summary();
  comparison.dark = dark.summary();
  comparison.blank = blank.summary();
  comparison.print_edges = print_edges.summary();
  return comparison;
}

}  // namespace pagesweep
