// SPDX-License-Identifier: Apache-2.0
// Frames in memory to points: station by station, and the whole way as the program goes it.
#include <fmt/format.h>

#include <algorithm>

#include "bench/comparison.h"
#include "bench/synthetic_sweep.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/camera/ray_table.h"
#include "pagesweep/pipeline/scan_page.h"

namespace pagesweep::bench {
namespace {

/// What the stations hand on.
struct Stations {
  const SyntheticScene& scene;
  const SyntheticFrames& made;
  std::vector<RayTable> rays = {};
  Timing timing = {};
  MatchPair matches = {};
  std::vector<PointMap> points = {};

  void estimate() { timing = estimate_times(made.frames); }
  void work_out_rays() { rays.assign(scene.rig.cameras.begin(), scene.rig.cameras.end()); }
  void match() { matches = match_times(timing.maps[0], timing.maps[1], rays[0], rays[1]); }
  void intersect() {
    points.clear();
    points.push_back(triangulate(matches.from_first, timing.maps[0].amplitude, rays[0], rays[1]));
    points.push_back(triangulate(matches.from_second, timing.maps[1].amplitude, rays[1], rays[0]));
  }
  void all() { work_out_rays(), estimate(), match(), intersect(); }
};

std::int64_t count_points(const std::vector<PointMap>& maps) {
  std::int64_t count = 0;
  for (const PointMap& map : maps) count += std::ranges::count(map.status.pixels(), PixelStatus::ok);
  return count;
}

Way with_threads(int threads, std::function<void()> work) {
  return Way{[=] {
    const ThreadLimit limit(threads);
    work();
  }};
}

}  // namespace

void measure_points(const Settings& settings, Report& report) {
  report.title("2 x 200 frames of 1024 x 1024 in memory to points in both directions");
  const SyntheticScene scene = make_scene(1024);
  const SyntheticFrames made = sweep_over(scene, {});
  Stations stations{scene, made};
  Rig rig = scene.rig;
  rig.light = made.light;
  std::unique_ptr<FrameSource> source;
  const auto load = [&] { source = source_of(made.frames); };
  std::vector<Way> ways;
  for (const int threads : {1, 2}) {
    ways.push_back(with_threads(threads, [&] { stations.all(); }));
    ways.push_back(with_threads(threads, [&] { stations.estimate(); }));
    ways.push_back(with_threads(threads, [&] { stations.work_out_rays(); }));
    ways.push_back(with_threads(threads, [&] { stations.match(); }));
    ways.push_back(with_threads(threads, [&] { stations.intersect(); }));
    ways.push_back(with_threads(threads, [&] { reconstruct(*source, rig); }));
    ways.back().prepare = load;
  }
  const auto seconds = interleave(settings.rounds, ways);
  for (const int threads : {1, 2}) {
    const auto k = static_cast<std::size_t>(6 * (threads - 1));
    const std::string with = fmt::format(", {} thread{}", threads, threads == 1 ? "" : "s");
    Figure all{"frames to points" + with, "s", seconds[k]};
    if (threads == 2) all.goal = 0.5;
    report.add(all);
    report.add({"of it, time values" + with, "s", seconds[k + 1]});
    report.add({"of it, viewing rays" + with, "s", seconds[k + 2]});
    report.add({"of it, matching" + with, "s", seconds[k + 3]});
    report.add({"of it, triangulation" + with, "s", seconds[k + 4]});
    report.add({"with edges corrected and the sheet of light fused" + with, "s", seconds[k + 5]});
  }
  report.add({"frames to points: speed of 2 threads over 1", "", ratios(seconds[0], seconds[6]), 1.8, true});
  report.add({"the whole way: speed of 2 threads over 1", "", ratios(seconds[5], seconds[11]), 1.8, true});
  report.add({"points", "", {static_cast<double>(count_points(stations.points))}});
  report.add({"points to the true surface, rms", "mm", {rms_error_mm(stations.points[0], scene.points[0])}});
}

}  // namespace pagesweep::bench
