// SPDX-License-Identifier: Apache-2.0
// Each station against straightforward scalar code, both on one thread.
#include <fmt/format.h>

#include <algorithm>

#include "bench/comparison.h"
#include "bench/plain_code.h"
#include "bench/synthetic_sweep.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/matching/match_sequences.h"
#include "pagesweep/timing/estimate_times.h"
#include "pagesweep/triangulation/triangulate.h"

namespace pagesweep::bench {
namespace {

constexpr double near_mm = 580, far_mm = 700;  // told to both

/// The truth where both ways have a point: an error over all of its own would reward who gives up first.
PointMap where_both(PointMap truth, const PointMap& a, const PointMap& b) {
  for (std::size_t k = 0; k < truth.status.size(); ++k)
    if (a.status.data()[k] != PixelStatus::ok || b.status.data()[k] != PixelStatus::ok)
      truth.status.data()[k] = PixelStatus::no_match;
  return truth;
}

/// Two ways to do the same, and the error that each leaves.
struct Rivals {
  std::string what;
  std::function<void()> ours, plain;
  std::function<double()> our_error = {}, plain_error = {};
  std::string unit = {};  ///< of the error
};

void compare(const Rivals& rivals, const Settings& settings, Report& report) {
  const std::vector<Way> ways = {{rivals.ours}, {rivals.plain}};
  const auto seconds = interleave(settings.rounds, ways);
  report.add({rivals.what, "s", seconds[0]});
  report.add({rivals.what + ", plain scalar code", "s", seconds[1]});
  report.add({rivals.what + ": plain scalar code over ours", "", ratios(seconds[1], seconds[0])});
  report.add({rivals.what + ": error", rivals.unit, {rivals.our_error()}});
  report.add({rivals.what + ", plain scalar code: error", rivals.unit, {rivals.plain_error()}});
}

/// Two matchers, by the points that their matches make.
void compare_matches(Rivals rivals, const Correspondences& ours, const Correspondences& plainly,
                     const SyntheticScene& scene, const std::vector<RayTable>& rays, const Settings& settings,
                     Report& report) {
  PointMap our_points, plain_points;
  rivals.our_error = [&] {
    our_points = triangulate(ours, {}, rays[0], rays[1]), plain_points = triangulate(plainly, {}, rays[0], rays[1]);
    return rms_error_mm(our_points, where_both(scene.points[0], our_points, plain_points));
  };
  rivals.plain_error = [&] {
    return rms_error_mm(plain_points, where_both(scene.points[0], our_points, plain_points));
  };
  rivals.unit = "mm";
  compare(rivals, settings, report);
  const auto points = [](const PointMap& map) {
    return static_cast<double>(std::ranges::count(map.status.pixels(), PixelStatus::ok));
  };
  report.add(
      {rivals.what + ": points over those of plain scalar code", "", {points(our_points) / points(plain_points)}});
}

void compare_stripes(const SyntheticScene& scene, const std::vector<RayTable>& rays, const Settings& settings,
                     Report& report) {
  const Sweep sweep;
  const SyntheticFrames made = sweep_over(scene, sweep);
  Timing timing = estimate_times(made.frames);
  std::vector<TimeMap> plain_maps(2);
  compare({"time values with a known stripe",
           [&] {
             for (std::size_t c = 0; c < 2; ++c)
               timing.maps[c] =
                   estimate_times(made.frames[c], timing.profile, timing.noise[c], timing.widths[c], TimingOptions{});
           },
           [&] {
             for (std::size_t c = 0; c < 2; ++c)
               plain_maps[c] = plain::estimate_times(made.frames[c], timing.profile, timing.noise[c]);
           },
           [&] { return error_over_bound(made, sweep, timing.maps); },
           [&] { return error_over_bound(made, sweep, plain_maps); }, "Cramér-Rao bounds"},
          settings, report);

  const InverseDepthRange depths{1 / far_mm, 1 / near_mm};
  const MatchOptions options{.near_mm = near_mm, .far_mm = far_mm};
  Correspondences ours, plainly;
  compare_matches({"time matching, both ways",
                   [&] { ours = match_times(timing.maps[0], timing.maps[1], rays[0], rays[1], options).from_first; },
                   [&] { plainly = plain::match_times(timing.maps[0], timing.maps[1], rays[0], rays[1], depths); }},
                  ours, plainly, scene, rays, settings, report);
  PointMap our_points, plain_points;
  compare({"triangulation, one way", [&] { our_points = triangulate(ours, {}, rays[0], rays[1]); },
           [&] { plain_points = plain::triangulate(ours, rays[0], rays[1]); },
           [&] { return rms_error_mm(our_points, scene.points[0]); },
           [&] { return rms_error_mm(plain_points, scene.points[0]); }, "mm"},
          settings, report);
}

void compare_sequences(const SyntheticScene& scene, const std::vector<RayTable>& rays, const Settings& settings,
                       Report& report) {
  const std::vector<Frames> waves = project_waves(scene, 24);
  const InverseDepthRange depths{1 / far_mm, 1 / near_mm};
  const MatchOptions options{.near_mm = near_mm, .far_mm = far_mm};
  Correspondences ours, plainly;
  compare_matches({"sequence matching, both ways",
                   [&] { ours = match_sequences(waves[0], waves[1], rays[0], rays[1], options).from_first; },
                   [&] { plainly = plain::match_sequences(waves[0], waves[1], rays[0], rays[1], depths); }},
                  ours, plainly, scene, rays, settings, report);
}

}  // namespace

void measure_plain_code(const Settings& settings, Report& report) {
  report.title("Stations against straightforward scalar code, one thread");
  const ThreadLimit one_thread(1);
  const SyntheticScene scene = make_scene(384), small_scene = make_scene(192);
  compare_stripes(scene, rays_of(scene), settings, report);
  compare_sequences(small_scene, rays_of(small_scene), settings, report);
}

}  // namespace pagesweep::bench
