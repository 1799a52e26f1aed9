// SPDX-License-Identifier: Apache-2.0
#include <benchmark/benchmark.h>
#include <malloc.h>

#include <chrono>
#include <cmath>
#include <vector>

#include "pagesweep/base/parallel.h"
#include "pagesweep/dewarping/dewarp.h"
#include "pagesweep/sim/analytic_scene.h"
#include "pagesweep/surfacing/fit_surface.h"
#include "pagesweep/surfacing/scenes_for_tests.h"

namespace pagesweep {
namespace {

/// An A3 spread: what two cameras of a megapixel measure of it, and its scan at 300 dpi in colour.
class Spread {
 public:
  static const Spread& get() {
    static const Spread spread;
    return spread;
  }

  std::vector<PointMap> points() const { return scenes::measure(scene_, {.width_px = 1024}); }
  const Scanner& scanner() const { return *rig_.scanner; }

  /// Paper coordinates of what the scan shows at a pixel, and the page (-1 left, 1 right); NaN beside the paper.
  Eigen::Vector3d paper_at(double u, double v) const {
    const auto ray = scanner().ray({u, v});
    const auto point = ray ? scene_.meet(*ray) : std::nullopt;
    if (!point) return Eigen::Vector3d::Constant(not_a_number);
    const double side = book_.book_from_rig(point->x(), point->y()).x() < 0 ? -1 : 1;
    const Eigen::Vector2d paper = book_.paper(point->x(), point->y(), static_cast<int>(side));
    return {paper.x(), paper.y(), side};
  }

  /// Lines of strokes on both pages, black beside them. Looked up every few pixels and interpolated in between.
  Picture scan() const {
    constexpr int pitch = 8;
    Picture picture = make_picture(scanner().width(), scanner().height(), 3, 8);
    auto& samples = std::get<Image<std::uint8_t>>(picture.samples);
    Image<Eigen::Vector3d> nodes(picture.width() / pitch + 2, picture.height() / pitch + 2, Eigen::Vector3d::Zero());
    parallel_rows(nodes.height(), [&](int j) {
      for (int i = 0; i < nodes.width(); ++i) nodes(i, j) = paper_at(i * pitch, j * pitch);
    });
    parallel_rows(picture.height(), [&](int y) {
      for (int x = 0; x < picture.width(); ++x) {
        const int i = x / pitch, j = y / pitch;
        const double a = double(x % pitch) / pitch, b = double(y % pitch) / pitch;
        Eigen::Vector3d paper = (1 - b) * ((1 - a) * nodes(i, j) + a * nodes(i + 1, j)) +
                                b * ((1 - a) * nodes(i, j + 1) + a * nodes(i + 1, j + 1));
        if (!(std::abs(paper.z()) == 1)) paper = paper_at(x, y);
        for (int c = 0; c < 3; ++c) samples(3 * x + c, y) = brightness(paper);
      }
    });
    return picture;
  }

  /// Rms distance [mm] of the pages' pixels from where the paper that they show lies, after the best rigid alignment.
  double error_mm(const std::vector<Page>& pages) const {
    double squares = 0, count = 0;
    for (const Page& page : pages) {
      std::vector<Eigen::Vector2d> is, should;
      for (int y = 20; y < page.picture.height(); y += 40)
        for (int x = 20; x < page.picture.width(); x += 40) {
          const Eigen::Vector3d paper = paper_at(page.scan_map.u(x, y), page.scan_map.v(x, y));
          if (!paper.allFinite() || paper.z() != (page.index == 1 ? -1 : 1)) continue;
          is.push_back(Eigen::Vector2d(x, y) / page.picture.pixels_per_mm);
          should.emplace_back(paper.head<2>());
        }
      const auto error = scenes::align(is, should);
      squares += error.nodes * error.rms_mm * error.rms_mm;
      count += error.nodes;
    }
    return std::sqrt(squares / count);
  }

 private:
  static std::uint8_t brightness(const Eigen::Vector3d& paper) {
    if (!paper.allFinite()) return 20;
    const double line = paper.y() - 5 * std::floor(paper.y() / 5), letter = paper.x() - 2 * std::floor(paper.x() / 2);
    return line < 2.5 && letter < 0.7 ? 60 : 220;
  }

  scenes::OpenBook book_{
      .turn_rad = 0.01,
      .gutter_p_mm = 3,
      .page_width_mm = 205,
      .page_height_mm = 290,
      .cut = scenes::Cut([](double s) { return (54 * std::exp(-s / 25) - 4) * std::numbers::pi / 180; }, 205)};
  sim::AnalyticScene scene_ = book_.scene();
  Rig rig_ = sim::make_test_rig(1024);
};

/// Memory that is freed stays with the process, as the program has it while it makes pages (cli/memory.h).
void keep_unused_memory() {
  mallopt(M_MMAP_THRESHOLD, 1 << 25);
  mallopt(M_TRIM_THRESHOLD, 1 << 29);
}

/// Two flat pages of 17 megapixels together, from points in memory.
void points_to_pages(benchmark::State& state) {
  keep_unused_memory();
  static const std::vector<PointMap> points = Spread::get().points();
  static const Picture scan = Spread::get().scan();
  const ThreadLimit limit(static_cast<int>(state.range(0)));
  std::vector<Page> pages;
  double surface_seconds = 0, pages_seconds = 0;
  const auto seconds = [](const auto& work) {
    const auto start = std::chrono::steady_clock::now();
    work();
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };
  for (auto _ : state) {
    std::vector<PageSurface> surfaces;
    surface_seconds += seconds([&] { surfaces = fit_surface(points); });
    pages_seconds += seconds([&] { pages = dewarp(surfaces, scan, Spread::get().scanner(), {.dpi = 300}); });
  }
  double pixels = 0;
  for (const Page& page : pages) pixels += double(page.picture.width()) * page.picture.height();
  state.counters["megapixels"] = 1e-6 * pixels;
  state.counters["surface_ms"] = 1e3 * surface_seconds / double(state.iterations());
  state.counters["pages_ms"] = 1e3 * pages_seconds / double(state.iterations());
  state.counters["error_mm"] = Spread::get().error_mm(pages);
}
BENCHMARK(points_to_pages)->ArgName("threads")->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
}  // namespace pagesweep
