// SPDX-License-Identifier: Apache-2.0
#include <benchmark/benchmark.h>

#include <cmath>
#include <random>

#include "pagesweep/matching/match_epipolar.h"
#include "pagesweep/matching/match_sequences.h"
#include "pagesweep/sim/analytic_scene.h"

namespace pagesweep {
namespace {

/// An open page, as both cameras see it.
struct Page {
  sim::AnalyticScene scene{[](double x, double) { return 30 + 25 * std::cos(x / 60); }, 60, 0};
  Rig rig;
  PointMap points1, points2;

  explicit Page(int width_px) : rig(sim::make_test_rig(width_px)) {
    points1 = scene.points(rig.cameras[0]);
    points2 = scene.points(rig.cameras[1]);
  }
};

constexpr float sigma_frames = 0.03f;

TimeMap noisy_times(const PointMap& points, const Light& light, unsigned seed) {
  TimeMap map(points.width(), points.height());
  std::mt19937 random(seed);
  std::normal_distribution<float> noise(0, sigma_frames);
  for (std::size_t i = 0; i < map.status.size(); ++i) {
    map.status.data()[i] = points.status.data()[i];
    if (map.status.data()[i] != PixelStatus::ok) continue;
    const Eigen::Vector3d point(points.x.data()[i], points.y.data()[i], points.z.data()[i]);
    map.time.data()[i] = static_cast<float>(*light.time_of(point)) + noise(random);
    map.sigma.data()[i] = sigma_frames;
  }
  return map;
}

/// Random waves of light, 8 bit, with noise of 1.5 gray values.
Frames exposed(const PointMap& points, const Camera& camera, int count, unsigned seed) {
  Frames frames({camera.name, camera.width, camera.height, count, 8, 2, 255});
  for (int i = 0; i < count; ++i) {
    std::mt19937 waves(static_cast<unsigned>(i)), random(seed * 1000 + static_cast<unsigned>(i));
    std::normal_distribution<double> noise(0, 1.5);
    std::uniform_real_distribution<double> uniform(0, 2 * M_PI);
    const double angle = uniform(waves), phase = uniform(waves), k = 2 * M_PI / (15 + 5 * uniform(waves));
    Image<std::uint8_t> image(camera.width, camera.height);
    for (std::size_t p = 0; p < image.size(); ++p) {
      const double along = points.x.data()[p] * std::cos(angle) + points.y.data()[p] * std::sin(angle);
      const double light = points.status.data()[p] == PixelStatus::ok ? 90 + 80 * std::sin(k * along + phase) : 0;
      image.data()[p] = static_cast<std::uint8_t>(std::lround(std::clamp(2 + light + noise(random), 0.0, 255.0)));
    }
    frames.set(i, std::move(image));
  }
  return frames;
}

/// Share of the matches' errors to their sigma, and how many there are.
void report(benchmark::State& state, const Correspondences& matches, const PointMap& points, const Camera& to) {
  double squares = 0, normalised = 0, count = 0;
  for (std::size_t i = 0; i < matches.status.size(); ++i) {
    if (matches.status.data()[i] != PixelStatus::ok || points.status.data()[i] != PixelStatus::ok) continue;
    const auto truth = to.project({points.x.data()[i], points.y.data()[i], points.z.data()[i]});
    const double error = std::hypot(matches.u.data()[i] - truth->x(), matches.v.data()[i] - truth->y());
    squares += error * error;
    normalised += std::pow(error / matches.sigma.data()[i], 2);
    ++count;
  }
  state.counters["matches"] = count;
  state.counters["rms_px"] = std::sqrt(squares / count);
  state.counters["error_over_sigma"] = std::sqrt(normalised / count);
}

void match_times_both_ways(benchmark::State& state) {
  const Page page(static_cast<int>(state.range(0)));
  const auto& [cam1, cam2] = std::tie(page.rig.cameras[0], page.rig.cameras[1]);
  const TimeMap times1 = noisy_times(page.points1, *page.rig.light, 1);
  const TimeMap times2 = noisy_times(page.points2, *page.rig.light, 2);
  MatchPair pair;
  for (auto _ : state) pair = match_times(times1, times2, cam1, cam2);
  report(state, pair.from_first, page.points1, cam2);
}
BENCHMARK(match_times_both_ways)->ArgName("width")->Arg(256)->Arg(1024)->Unit(benchmark::kMillisecond)->UseRealTime();

void match_sequences_both_ways(benchmark::State& state) {
  const Page page(static_cast<int>(state.range(0)));
  const auto& [cam1, cam2] = std::tie(page.rig.cameras[0], page.rig.cameras[1]);
  const int count = static_cast<int>(state.range(1));
  const Frames frames1 = exposed(page.points1, cam1, count, 1), frames2 = exposed(page.points2, cam2, count, 2);
  MatchPair pair;
  for (auto _ : state) pair = match_sequences(frames1, frames2, cam1, cam2);
  report(state, pair.from_first, page.points1, cam2);
}
BENCHMARK(match_sequences_both_ways)
    ->ArgNames({"width", "frames"})
    ->Args({256, 24})
    ->Args({1024, 24})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

}  // namespace
}  // namespace pagesweep
