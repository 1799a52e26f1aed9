// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/sensor_noise.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace pagesweep {
namespace {

/// One level of gray and the variance there.
struct Level {
  double gray, variance, samples;
};

/// Mean of the squares without those that no normal scatter explains. Starts from the median, which for normal
/// residuals is 0.455 of the variance.
Level robust_level(std::span<NoiseSample> bin) {
  constexpr double limit = 3.5 * 3.5;  // squared standard deviations: keeps 99.95 % of a normal distribution
  const auto middle = bin.begin() + static_cast<std::ptrdiff_t>(bin.size() / 2);
  std::nth_element(bin.begin(), middle, bin.end(),
                   [](const NoiseSample& a, const NoiseSample& b) { return a.squared_residual < b.squared_residual; });
  double variance = std::max(middle->squared_residual / 0.455, quantisation_variance);
  double gray = 0;
  for (int iteration = 0; iteration < 5; ++iteration) {
    double squares = 0, grays = 0, kept = 0;
    for (const NoiseSample& sample : bin) {
      if (sample.squared_residual > limit * variance) continue;
      squares += sample.squared_residual;
      grays += sample.gray;
      kept += 1;
    }
    variance = squares / kept;
    gray = grays / kept;
  }
  return {gray, std::max(variance, quantisation_variance), static_cast<double>(bin.size())};
}

/// Line through the levels; a variance scatters in proportion to itself, so the weights are samples / variance^2.
SensorNoise fit_line(std::span<const Level> levels) {
  double w = 0, wx = 0, wxx = 0, wy = 0, wxy = 0;
  for (const Level& level : levels) {
    const double weight = level.samples / (level.variance * level.variance);
    const double x = std::max(level.gray, 0.0);
    w += weight;
    wx += weight * x;
    wxx += weight * x * x;
    wy += weight * level.variance;
    wxy += weight * x * level.variance;
  }
  const double determinant = w * wxx - wx * wx;
  SensorNoise noise;
  noise.gain = determinant > 1e-9 * w * wxx ? std::max(0.0, (w * wxy - wx * wy) / determinant) : 0;
  noise.read_variance = (wy - noise.gain * wx) / w;
  if (noise.read_variance < quantisation_variance) {
    noise.read_variance = quantisation_variance;
    noise.gain = wxx > 0 ? std::max(0.0, (wxy - noise.read_variance * wx) / wxx) : 0;
  }
  return noise;
}

/// Brings samples into an order in which the bins that `borders` part follow one another by gray value.
void sort_into_bins(std::span<NoiseSample> samples, std::span<const std::size_t> borders, std::size_t first = 0) {
  if (borders.empty()) return;
  const std::size_t half = borders.size() / 2, border = borders[half] - first;
  const auto middle = samples.begin() + static_cast<std::ptrdiff_t>(border);
  std::nth_element(samples.begin(), middle, samples.end(),
                   [](const NoiseSample& a, const NoiseSample& b) { return a.gray < b.gray; });
  sort_into_bins(samples.first(border), borders.first(half), first);
  sort_into_bins(samples.subspan(border), borders.subspan(half + 1), first + border);
}

}  // namespace

FrameNoise::FrameNoise(const SensorNoise& sensor, std::vector<double> exposures)
    : sensor_(sensor), exposures_(std::move(exposures)), highest_ceiling_(sensor.ceiling) {
  double weights = 0;
  for (const double e : exposures_) {
    frames_.push_back({sensor.read_variance / (e * e), sensor.gain / e, sensor.ceiling / e});
    weights += e * e;
    highest_ceiling_ = std::max(highest_ceiling_, sensor.ceiling / e);
  }
  if (!exposures_.empty()) mean_weight_ = weights / static_cast<double>(exposures_.size());
}

SensorNoise fit_sensor_noise(std::span<const NoiseSample> samples) {
  constexpr std::size_t fewest = 50, most_bins = 24;
  if (samples.size() < fewest) return {};
  std::vector<NoiseSample> sorted(samples.begin(), samples.end());
  const std::size_t bins = std::min(most_bins, sorted.size() / (fewest / 2));
  std::vector<std::size_t> borders;
  for (std::size_t i = 1; i < bins; ++i) borders.push_back(i * sorted.size() / bins);
  sort_into_bins(sorted, borders);
  std::vector<Level> levels;
  for (std::size_t i = 0; i < bins; ++i) {
    const std::size_t begin = i * sorted.size() / bins, end = (i + 1) * sorted.size() / bins;
    levels.push_back(robust_level(std::span(sorted).subspan(begin, end - begin)));
  }
  return fit_line(levels);
}

}  // namespace pagesweep
