// SPDX-License-Identifier: Apache-2.0
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>

#include "pagesweep/dewarping/dewarp.h"
#include "pagesweep/dewarping/page_outline.h"
#include "pagesweep/dewarping/paper_view.h"
#include "pagesweep/dewarping/printed_page_testing.h"
#include "pagesweep/dewarping/scan_map.h"

namespace pagesweep {
namespace {

const Sheet sheet = cylinder(150, 20);
const PageFrame paper{{-105, -148}, 0, 210, 297};

/// An A4 page with strokes, seen in colour at 300 dpi.
struct A4 {
  PageSurface surface = make_surface(sheet, sheet, {-115, -158}, {115, 158});
  Scanner scanner = make_small_scanners(300 / 25.4, 2700, 3700)[1].second;
  Picture scan;

  A4() {
    const StrokePattern strokes(3000, 2);
    const auto print = [&](double s, double t) {
      return paper.contains({s, t}) ? strokes.at(10 * (s - paper.corner_mm.x()), 10 * (t - paper.corner_mm.y())) : 0.1;
    };
    scan = render_scan(sheet, scanner, print, 1, 3);
  }
  static const A4& get() {
    static const A4 a4;
    return a4;
  }
};

double corner_error_mm(const PageFrame& frame) {
  const Eigen::Vector2d far = frame.paper_from_page({frame.width_mm, frame.height_mm});
  return std::max((frame.corner_mm - paper.corner_mm).norm(), (far - Eigen::Vector2d(105, 149)).norm());
}

void find_outline_of_a4(benchmark::State& state) {
  const A4& a4 = A4::get();
  const PaperView view(a4.surface, a4.scanner, PaperShape::measured);
  PageOutline outline;
  for (auto _ : state) outline = find_page_outline(view, a4.scan);
  state.counters["corner_error_mm"] = corner_error_mm(outline.frame);
}

void map_a4(benchmark::State& state) {
  const A4& a4 = A4::get();
  const PaperView view(a4.surface, a4.scanner, PaperShape::measured);
  const double scale = 300 / 25.4;
  ScanMap map;
  for (auto _ : state) map = build_scan_map(view, Occlusion({&view, 1}), paper, scale);
  double largest = 0;
  for (int y = 0; y < map.height(); y += 13)
    for (int x = 0; x < map.width(); x += 7) {
      const Eigen::Vector2d at = paper.paper_at_pixel(x, y, scale);
      const Eigen::Vector2d truth = *a4.scanner.project(sheet(at.x(), at.y()));
      largest = std::max(largest, (Eigen::Vector2d(map.u(x, y), map.v(x, y)) - truth).norm());
    }
  state.SetItemsProcessed(state.iterations() * map.width() * map.height());
  state.counters["largest_error_px"] = largest;
}

void dewarp_a4(benchmark::State& state) {
  const A4& a4 = A4::get();
  std::vector<Page> pages;
  for (auto _ : state) pages = dewarp({&a4.surface, 1}, a4.scan, a4.scanner, {.dpi = 300});
  state.SetItemsProcessed(state.iterations() * pages[0].picture.width() * pages[0].picture.height());
  state.counters["width_error_mm"] = pages[0].picture.width() / pages[0].picture.pixels_per_mm - paper.width_mm;
}

BENCHMARK(find_outline_of_a4)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(map_a4)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(dewarp_a4)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
}  // namespace pagesweep
