// SPDX-License-Identifier: Apache-2.0
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <string>
#include <type_traits>
#include <vector>

#ifdef PAGESWEEP_WITH_OPENCV
#include <opencv2/imgproc.hpp>
#endif

#include "pagesweep/base/parallel.h"
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

BENCHMARK_CAPTURE(resample_a_page, vectors, &resample)
    ->ArgNames({"side", "kernel"})
    ->ArgsProduct({{2048}, {0, 1, 2}})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();
BENCHMARK_CAPTURE(resample_a_page, plain_loop, &resample_plainly)
    ->ArgNames({"side", "kernel"})
    ->ArgsProduct({{512}, {0, 1, 2}})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

#ifdef PAGESWEEP_WITH_OPENCV
/// The same map through OpenCV's cubic interpolation (A = -0.75, positions in 1/32 px, no widening), with as many
/// threads.
Picture remap_with_opencv(const Picture& scan, const ScanMap& map) {
  Picture page = make_picture(map.width(), map.height(), scan.channels, scan.bit_depth());
  const auto depth = scan.bit_depth() == 8 ? CV_8U : CV_16U;
  const auto as_matrix = [](const auto& image, int width, int type) {
    using Sample = std::remove_cvref_t<decltype(*image.data())>;
    return cv::Mat(image.height(), width, type, const_cast<Sample*>(image.data()));
  };
  std::visit(
      [&]<class T>(const Image<T>& samples) {
        const int type = CV_MAKETYPE(depth, scan.channels);
        cv::Mat out = as_matrix(std::get<Image<T>>(page.samples), page.width(), type);
        cv::remap(as_matrix(samples, scan.width(), type), out, as_matrix(map.u, map.width(), CV_32F),
                  as_matrix(map.v, map.width(), CV_32F), cv::INTER_CUBIC, cv::BORDER_REPLICATE);
      },
      scan.samples);
  return page;
}

/// Both resamplers by turns, so that whatever disturbs the machine disturbs both. Arguments: side of the page, kernel,
/// channels, bits, threads.
void resample_and_opencv(benchmark::State& state) {
  const int side = static_cast<int>(state.range(0));
  const auto kernel = static_cast<ResampleKernel>(state.range(1));
  const ScanMap map = make_curved_map(side);
  const StrokePattern strokes(side + 40, 0.6);
  const Picture scan =
      strokes.render(side + 40, side + 40, static_cast<int>(state.range(2)), static_cast<int>(state.range(3)));
  const ThreadLimit limit(static_cast<int>(state.range(4)));
  cv::setNumThreads(static_cast<int>(state.range(4)));
  Picture ours, theirs;
  std::vector<double> our_seconds, their_seconds;
  const auto timed = [](std::vector<double>& seconds, const auto& work) {
    const auto start = std::chrono::steady_clock::now();
    work();
    seconds.push_back(std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  };
  for (auto _ : state) {
    timed(our_seconds, [&] { ours = resample(scan, map, 300 / 25.4, {.kernel = kernel}); });
    timed(their_seconds, [&] { theirs = remap_with_opencv(scan, map); });
  }
  const auto median = [](std::vector<double> values) {
    std::ranges::nth_element(values, values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2));
    return values[values.size() / 2];
  };
  const auto truth = [&](double u, double v) { return strokes.at(u, v); };
  state.counters["ours_ms"] = 1e3 * median(our_seconds);
  state.counters["opencv_ms"] = 1e3 * median(their_seconds);
  state.counters["time_ratio"] = median(our_seconds) / median(their_seconds);
  state.counters["ours_psnr_db"] = psnr_db(ours, map, truth);
  state.counters["opencv_psnr_db"] = psnr_db(theirs, map, truth);
  state.SetLabel(std::string(name_of(kernel)));
}

BENCHMARK(resample_and_opencv)
    ->ArgNames({"side", "kernel", "channels", "bits", "threads"})
    ->ArgsProduct({{4096}, {0, 2}, {3}, {8}, {1, 2}})
    ->ArgsProduct({{2048}, {0, 2}, {1, 3}, {8, 16}, {1}})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();
#endif

}  // namespace
}  // namespace pagesweep
