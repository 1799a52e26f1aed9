// SPDX-License-Identifier: Apache-2.0
// What is left to do when the last frame is there.
#include <fmt/format.h>

#include <chrono>
#include <utility>

#include "bench/comparison.h"
#include "bench/synthetic_sweep.h"
#include "pagesweep/pipeline/scan_page.h"
#include "pagesweep/timing/time_stream.h"

namespace pagesweep::bench {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

/// Hands on another source's frames, and remembers when the last one left it.
class WatchedSource final : public FrameSource {
 public:
  explicit WatchedSource(FrameSource& source) : source_(source) {}
  const std::vector<Sequence>& sequences() const override { return source_.sequences(); }
  std::optional<FrameSet> next() override {
    auto set = source_.next();
    if (set) last_ = Clock::now();
    return set;
  }
  Clock::time_point last() const { return last_; }

 private:
  FrameSource& source_;
  Clock::time_point last_;
};

/// Seconds from the last frame to the time values, and how many frames were kept at most.
std::pair<double, int> follow(const std::vector<Frames>& frames, std::vector<TimeMap>& maps) {
  const auto source = source_of(frames);
  TimeStream times(source->sequences());
  int kept = 0;
  Clock::time_point last;
  while (auto set = source->next()) {
    last = Clock::now();
    times.add(*std::move(set));
    kept = std::max(kept, times.frames_kept());
  }
  maps = times.finish().maps;
  return {seconds_since(last), kept};
}

}  // namespace

void measure_streaming(const Settings& settings, Report& report) {
  const SyntheticScene scene = make_scene(1024);
  for (const int after : {0, 40, 80}) {
    report.title(fmt::format("2 x 200 frames of 1024 x 1024 that come in one after the other, and {} more", after));
    const Sweep sweep{.after = after};
    const SyntheticFrames made = sweep_over(scene, sweep);
    std::vector<double> to_times, to_points, kept, error, point_error;
    for (int round = 0; round < settings.rounds; ++round) {
      std::vector<TimeMap> maps;
      const auto [seconds, most_kept] = follow(made.frames, maps);
      to_times.push_back(seconds);
      kept.push_back(most_kept);
      error.push_back(error_over_bound(made, sweep, maps));
      const auto source = source_of(made.frames);
      WatchedSource watched(*source);
      const Measurement measured = reconstruct(watched, scene.rig);
      to_points.push_back(seconds_since(watched.last()));
      point_error.push_back(rms_error_mm(measured.points[0], scene.points[0]));
    }
    report.add({"from the last frame to the time values", "s", to_times});
    report.add({"from the last frame to the point maps", "s", to_points, 0.06});
    report.add({"frames kept at most, both cameras together", "", kept});
    report.add({"time values: rms error over the Cramér-Rao bound", "", error, 1.05});
    report.add({"points to the true surface, rms", "mm", point_error});
  }
}

}  // namespace pagesweep::bench
