// SPDX-License-Identifier: Apache-2.0
// Time values of two cameras' frames, against one look at the same bytes.
#include <fmt/format.h>

#include "bench/comparison.h"
#include "bench/memory_pass.h"
#include "bench/synthetic_sweep.h"
#include "pagesweep/timing/estimate_times.h"

namespace pagesweep::bench {

void measure_time_values(const Settings& settings, Report& report) {
  report.title("Time values of 2 x 200 frames of 1024 x 1024 in memory");
  const Sweep sweep;
  const SyntheticFrames made = sweep_over(make_scene(1024), sweep);
  Timing timing;
  std::vector<Way> ways;
  for (const int threads : {1, 2}) {
    const auto with_threads = [=](const auto& work) {
      return Way{[=] {
        const ThreadLimit limit(threads);
        work();
      }};
    };
    ways.push_back(with_threads([&] { read_plainly(made.frames); }));
    ways.push_back(with_threads([&] { copy_plainly(made.frames); }));
    ways.push_back(with_threads([&] { timing = estimate_times(made.frames); }));
  }
  const auto seconds = interleave(settings.rounds, ways);
  for (const int threads : {1, 2}) {
    const auto k = static_cast<std::size_t>(3 * (threads - 1));
    const std::string with = fmt::format(", {} thread{}", threads, threads == 1 ? "" : "s");
    report.add({"plain read" + with, "s", seconds[k]});
    report.add({"copy" + with, "s", seconds[k + 1]});
    report.add({"time values" + with, "s", seconds[k + 2]});
    report.add({"time values over the plain read" + with, "", ratios(seconds[k + 2], seconds[k]), 3});
    report.add({"time values over the copy" + with, "", ratios(seconds[k + 2], seconds[k + 1])});
  }
  report.add({"time values: speed of 2 threads over 1", "", ratios(seconds[2], seconds[5]), 1.8, true});
  report.add(
      {"time values: rms error over the Cramér-Rao bound", "", {error_over_bound(made, sweep, timing.maps)}, 1.05});
}

}  // namespace pagesweep::bench
