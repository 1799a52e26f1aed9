// SPDX-License-Identifier: Apache-2.0
// How the time grows with what there is to do: exponents of pixels, frames, depth range and page size.
#include <array>
#include <cmath>

#include "bench/comparison.h"
#include "bench/synthetic_sweep.h"
#include "pagesweep/camera/ray_table.h"
#include "pagesweep/dewarping/dewarp.h"
#include "pagesweep/matching/match_sequences.h"
#include "pagesweep/sim/analytic_scene.h"
#include "pagesweep/surfacing/fit_surface.h"
#include "pagesweep/timing/estimate_times.h"
#include "pagesweep/triangulation/triangulate.h"

namespace pagesweep::bench {
namespace {

constexpr double most_exponent = 1.05;  ///< the goal: no worse than what there is to do
constexpr double table_mm = 640;        ///< from the cameras, about

/// Adds the exponent of one kind of work over one kind of size.
void measure(const std::string& what, const std::array<double, 4>& sizes, const std::array<Way, 4>& ways,
             const Settings& settings, Report& report) {
  const auto seconds = interleave(settings.rounds, ways);
  report.add({what + ", the largest", "s", seconds.back()});
  report.add({what + ": exponent", "", exponents(sizes, seconds), most_exponent});
}

/// Given, and not found automatically: these are the same for pictures of all sizes. A millimetre is 2 px of an
/// epipolar curve: in no picture it leaves before its end, which would make the small ones easier than the large ones.
MatchOptions depths_around_table(double range_mm) {
  return {.near_mm = table_mm - range_mm / 2, .far_mm = table_mm + range_mm / 2};
}

double pixels_of(int side_px) { return 2.0 * side_px * side_px; }

void grow_pixels(const Settings& settings, Report& report) {
  constexpr std::array<int, 4> sides = {256, 416, 640, 1024}, sides_for_sequences = {192, 256, 384, 576};
  std::array<double, 4> pixels{}, pixels_for_sequences{};
  std::array<Way, 4> times, points, sequences;
  std::vector<SyntheticFrames> sweeps;
  std::vector<Timing> timings;
  std::vector<std::vector<Frames>> waves;
  std::vector<std::vector<RayTable>> rays, rays_for_sequences;
  const MatchOptions depths = depths_around_table(40), whole_page = depths_around_table(100);
  for (std::size_t k = 0; k < sides.size(); ++k) {
    const SyntheticScene scene = make_scene(sides[k]), small_scene = make_scene(sides_for_sequences[k]);
    pixels[k] = pixels_of(sides[k]), pixels_for_sequences[k] = pixels_of(sides_for_sequences[k]);
    sweeps.push_back(sweep_over(scene, {.count = 100}));
    timings.push_back(estimate_times(sweeps[k].frames));
    waves.push_back(project_waves(small_scene, 12));
    rays.push_back(rays_of(scene));
    rays_for_sequences.push_back(rays_of(small_scene));
    times[k].run = [&, k] { estimate_times(sweeps[k].frames); };
    points[k].run = [&, k] {
      const auto& maps = timings[k].maps;
      const MatchPair matches = match_times(maps[0], maps[1], rays[k][0], rays[k][1], whole_page);
      triangulate(matches.from_first, maps[0].amplitude, rays[k][0], rays[k][1]);
      triangulate(matches.from_second, maps[1].amplitude, rays[k][1], rays[k][0]);
    };
    sequences[k].run = [&, k] {
      match_sequences(waves[k][0], waves[k][1], rays_for_sequences[k][0], rays_for_sequences[k][1], depths);
    };
  }
  measure("time values over pixels", pixels, times, settings, report);
  measure("time matching and triangulation over pixels", pixels, points, settings, report);
  measure("sequence matching over pixels", pixels_for_sequences, sequences, settings, report);
}

void grow_frames(const Settings& settings, Report& report) {
  constexpr std::array<double, 4> for_times = {50, 100, 200, 400}, for_sequences = {12, 24, 48, 96};
  std::array<Way, 4> times, sequences;
  const SyntheticScene scene = make_scene(512), small_scene = make_scene(256);
  const std::vector<RayTable> small_rays = rays_of(small_scene);
  std::vector<SyntheticFrames> sweeps;
  std::vector<std::vector<Frames>> waves;
  const MatchOptions depths = depths_around_table(40);
  for (std::size_t k = 0; k < 4; ++k) {
    sweeps.push_back(sweep_over(scene, {.count = static_cast<int>(for_times[k])}));
    waves.push_back(project_waves(small_scene, static_cast<int>(for_sequences[k])));
    times[k].run = [&, k] { estimate_times(sweeps[k].frames); };
    sequences[k].run = [&, k] {
      match_sequences(waves[k][0], waves[k][1], small_scene.rig.cameras[0], small_scene.rig.cameras[1], depths);
    };
  }
  measure("time values over frames", for_times, times, settings, report);
  measure("sequence matching over frames", for_sequences, sequences, settings, report);
}

void grow_depths(const Settings& settings, Report& report) {
  constexpr std::array<double, 4> ranges_mm = {10, 20, 40, 80};
  std::array<Way, 4> times, sequences;
  const SyntheticScene scene = make_scene(1024), small_scene = make_scene(384);
  const std::vector<RayTable> rays = rays_of(scene), small_rays = rays_of(small_scene);
  const SyntheticFrames sweep = sweep_over(scene, {.count = 100});
  const Timing timing = estimate_times(sweep.frames);
  const std::vector<Frames> waves = project_waves(small_scene, 12);
  for (std::size_t k = 0; k < 4; ++k) {
    const MatchOptions depths = depths_around_table(ranges_mm[k]);
    times[k].run = [&, depths] {
      match_times(timing.maps[0], timing.maps[1], scene.rig.cameras[0], scene.rig.cameras[1], depths);
    };
    sequences[k].run = [&, depths] {
      match_sequences(waves[0], waves[1], small_scene.rig.cameras[0], small_scene.rig.cameras[1], depths);
    };
  }
  measure("time matching over the depth range", ranges_mm, times, settings, report);
  measure("sequence matching over the depth range", ranges_mm, sequences, settings, report);
}

/// A curved sheet of paper in the middle of the table.
std::vector<PointMap> points_of_sheet(const Rig& rig, double width_mm, double height_mm) {
  const auto height = [=](double x, double y) {
    const bool is_paper = std::abs(x) <= width_mm / 2 && std::abs(y) <= height_mm / 2;
    return is_paper ? 20 + 8 * std::cos(x / 60) : double{not_a_number};
  };
  std::vector<PointMap> points;
  for (const Camera& camera : rig.cameras) points.push_back(sim::AnalyticScene{height, 30, 0}.points(camera));
  return points;
}

/// The cameras and the scan stay, so that what is paid for the table is paid alike.
void grow_pages(const Settings& settings, Report& report) {
  constexpr std::array<double, 4> widths_mm = {148, 210, 297, 420}, heights_mm = {105, 148, 210, 290};  // A6 ... A3
  const Rig rig = sim::make_test_rig(1024);
  Picture scan = make_picture(rig.scanner->width(), rig.scanner->height(), 3, 8);
  for (std::uint8_t& sample : std::get<Image<std::uint8_t>>(scan.samples).pixels()) sample = 220;
  std::array<double, 4> areas{};
  std::array<Way, 4> surfaces, pages;
  std::array<std::vector<PointMap>, 4> points;
  std::array<std::vector<PageSurface>, 4> fitted;
  for (std::size_t k = 0; k < 4; ++k) {
    areas[k] = widths_mm[k] * heights_mm[k];
    points[k] = points_of_sheet(rig, widths_mm[k], heights_mm[k]);
    surfaces[k].run = [&, k] { fitted[k] = fit_surface(points[k]); };
    pages[k].run = [&, k] { dewarp(fitted[k], scan, *rig.scanner, {.dpi = 300}); };
  }
  measure("points to surface over the page's size", areas, surfaces, settings, report);
  measure("surface to page over the page's size", areas, pages, settings, report);
}

}  // namespace

void measure_growth(const Settings& settings, Report& report) {
  report.title("Growth");
  grow_pixels(settings, report);
  grow_frames(settings, report);
  grow_depths(settings, report);
  grow_pages(settings, report);
}

}  // namespace pagesweep::bench
