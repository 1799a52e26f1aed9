// SPDX-License-Identifier: Apache-2.0
#include <benchmark/benchmark.h>

#include <cmath>
#include <string>

#include "pagesweep/dewarping/printed_page_testing.h"
#include "pagesweep/dewarping/resample.h"

namespace pagesweep {
namespace {

/// A page that is turned, curved and a little smaller or larger than the scan: what dewarping asks for.
ScanMap make_curved_map(int side) {
  ScanMap map(side, side);
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x) {
      map.u(x, y) = static_cast<float>(12.3 + 0.99 * x + 4 * std::sin(5e-3 * x) - 0.004 * y);
      map.v(x, y) = static_cast<float>(11.7 + 0.99 * y + 4 * std::sin(5e-3 * x) + 0.004 * x);
    }
  return map;
}

using Function = Picture (*)(const Picture&, const ScanMap&, double, const ResampleOptions&);

void resample_a_page(benchmark::State& state, Function function) {
  const int side = static_cast<int>(state.range(0));
  const auto kernel = static_cast<ResampleKernel>(state.range(1));
  const ScanMap map = make_curved_map(side);
  const StrokePattern strokes(side + 40, 0.6);
  const Picture scan = strokes.render(side + 40, side + 40, 3, 8);
  Picture page;
  for (auto _ : state) page = function(scan, map, 300 / 25.4, {.kernel = kernel});
  state.SetItemsProcessed(state.iterations() * side * side);
  state.counters["psnr_db"] = psnr_db(page, map, [&](double u, double v) { return strokes.at(u, v); });
  state.SetLabel(std::string(name_of(kernel)));
}

BENCHMARK_CAPTURE(resample_a_page, tables, &resample)
    ->ArgNames({"side", "kernel"})
    ->ArgsProduct({{2048}, {0, 1, 2}})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();
BENCHMARK_CAPTURE(resample_a_page, plain_loop, &resample_plainly)
    ->ArgNames({"side", "kernel"})
    ->ArgsProduct({{512}, {0, 1, 2}})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

}  // namespace
}  // namespace pagesweep
