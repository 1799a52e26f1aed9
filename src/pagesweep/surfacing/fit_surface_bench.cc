// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/surfacing/fit_surface.h"

#include <benchmark/benchmark.h>

#include "pagesweep/surfacing/scenes_for_tests.h"

namespace pagesweep {
namespace {

/// An open book as two cameras of this width measure it; error_mm is the rms error of the flattening.
void fit_an_open_book(benchmark::State& state) {
  const scenes::OpenBook book;
  const auto points = scenes::measure(book.scene(), {.width_px = static_cast<int>(state.range(0))});
  std::vector<PageSurface> pages;
  for (auto _ : state) pages = fit_surface(points);
  double worst = 0;
  for (const PageSurface& page : pages) {
    const auto paper = [&](double x, double y) { return book.paper(x, y, page.index == 1 ? -1 : 1); };
    worst = std::max(worst, scenes::flattening_error(page, page.measured, paper).rms_mm);
  }
  state.counters["error_mm"] = worst;
}
BENCHMARK(fit_an_open_book)->ArgName("width_px")->Arg(256)->Arg(1024)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
}  // namespace pagesweep
