// SPDX-License-Identifier: Apache-2.0
#include <benchmark/benchmark.h>

#include <array>
#include <numeric>
#include <string>

#include "pagesweep/base/parallel.h"
#include "pagesweep/timing/estimate_times.h"
#include "pagesweep/timing/learn_profile.h"
#include "pagesweep/timing/stripe_pixel_testing.h"

namespace pagesweep {
namespace {

constexpr int width = 128, height = 96, frame_count = 200;

/// Every fourth row is bright paper to learn from, the others are what is measured.
bool is_teaching(int y) { return y % 4 == 0; }

/// Time values by estimator (0: centre of mass, 2: profile, 3: refined), amplitude [gray values] and stripe sigma
/// [tenths of a frame]. Counters: rms error and phase bias over the Cramer-Rao bound, rms of error over claimed sigma.
void estimate_times_of_a_camera(benchmark::State& state) {
  const ThreadLimit one_thread(1);
  const auto shape = testing::gaussian(0.1 * static_cast<double>(state.range(2)));
  const testing::Sensor sensor{.gain = 0.02, .read_noise = 1.2};
  const auto pixel_at = [&](int x, int y) {
    return testing::Pixel{.amplitude = is_teaching(y) ? 200.0 : static_cast<double>(state.range(1)),
                          .time = 100 + x * 0.0625 + 0.013 * y};
  };
  const Frames frames = testing::make_frames(width, height, frame_count, shape, sensor, pixel_at);
  const LearnedStripe learned = learn_stripe({&frames, 1});
  const StripeWidths widths = measure_widths(frames, learned.profile, learned.noise[0]);
  const TimingOptions options{.estimator = static_cast<TimeEstimator>(state.range(0)), .max_sigma = 10};
  TimeMap map;
  for (auto _ : state) map = estimate_times(frames, learned.profile, learned.noise[0], widths, options);
  state.SetItemsProcessed(state.iterations() * width * height);

  constexpr int phases = 8;
  double squares = 0, bounds = 0, normalised = 0, count = 0;
  std::array<double, phases> bias{}, hits{};
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      if (is_teaching(y) || map.status(x, y) != PixelStatus::ok) continue;
      const testing::Pixel pixel = pixel_at(x, y);
      const double least = testing::cramer_rao_bound(shape, pixel, sensor, frame_count);
      const double error = map.time(x, y) - pixel.time;
      const auto phase = static_cast<std::size_t>((pixel.time - std::floor(pixel.time)) * phases);
      squares += error * error, bounds += least * least, count += 1;
      normalised += std::pow(error / map.sigma(x, y), 2);
      bias[phase] += error, hits[phase] += 1;
    }
  double bias_squares = 0;
  const double mean = std::accumulate(bias.begin(), bias.end(), 0.0) / count;  // of no consequence: cameras share it
  const double bound = std::sqrt(bounds / count);
  for (std::size_t i = 0; i < phases; ++i)
    state.counters["bias_vs_bound_at_phase_" + std::to_string(i)] = (bias[i] / hits[i] - mean) / bound;
  for (std::size_t i = 0; i < phases; ++i) bias_squares += std::pow(bias[i] / hits[i] - mean, 2) / phases;
  bias_squares = std::max(0.0, bias_squares - squares / count / (count / phases));  // without its own noise
  state.counters["error_vs_bound"] = std::sqrt(squares / bounds);
  state.counters["bias_vs_bound"] = std::sqrt(bias_squares / (bounds / count));
  state.counters["error_vs_sigma"] = std::sqrt(normalised / count);
}
BENCHMARK(estimate_times_of_a_camera)
    ->ArgNames({"estimator", "amplitude", "sigma"})
    ->ArgsProduct({{0, 2, 3}, {15, 27, 80, 180, 245}, {15, 40, 80}})
    ->Unit(benchmark::kMillisecond);

void learn_stripe_of_a_camera(benchmark::State& state) {
  const ThreadLimit one_thread(1);
  const Frames frames = testing::make_frames(width, height, frame_count, testing::gaussian(4), {}, [](int x, int y) {
    return testing::Pixel{.time = 80 + 0.3 * y + 0.01 * x};
  });
  for (auto _ : state) benchmark::DoNotOptimize(learn_stripe({&frames, 1}));
}
BENCHMARK(learn_stripe_of_a_camera)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace pagesweep
