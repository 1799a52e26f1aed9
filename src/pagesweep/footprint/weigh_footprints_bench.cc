// SPDX-License-Identifier: Apache-2.0
#include <benchmark/benchmark.h>

#include <Eigen/Core>
#include <cmath>

#include "pagesweep/base/parallel.h"
#include "pagesweep/data/linear_light.h"
#include "pagesweep/footprint/weigh_footprints.h"
#include "pagesweep/sim/analytic_scene.h"

namespace pagesweep {
namespace {

constexpr double spot_variance_px2 = 0.4;

/// Lines of strokes in colour, over `printed` of the page's height, on slightly uneven paper.
Picture print(const Scanner& scanner, double printed) {
  Picture scan = make_picture(scanner.width(), scanner.height(), 3, 8);
  auto& samples = std::get<Image<std::uint8_t>>(scan.samples);
  parallel_rows(scan.height(), [&](int y) {
    for (int x = 0; x < scan.width(); ++x) {
      const bool ink = y < printed * scan.height() && y % 60 < 30 && (x + y / 3) % 24 < 8;
      for (int c = 0; c < 3; ++c)
        samples(3 * x + c, y) = static_cast<std::uint8_t>((ink ? 60 : 225) + (x * 7 + y * 13) % 5 - c);
    }
  });
  return scan;
}

/// The middle of a spot by a sum over places a tenth of a standard deviation apart.
Eigen::Vector2d fine_middle(const PointMap& points, const Scanner& scanner, const Picture& scan, int x, int y) {
  const auto at = [&](int i, int j) { return *scanner.project({points.x(i, j), points.y(i, j), points.z(i, j)}); };
  const Eigen::Vector2d middle = at(x, y), across = 0.25 * (at(x + 2, y) - at(x - 2, y)),
                        down = 0.25 * (at(x, y + 2) - at(x, y - 2));
  const auto& samples = std::get<Image<std::uint8_t>>(scan.samples);
  const auto light = [&](const Eigen::Vector2d& p) {
    const auto i = static_cast<int>(std::floor(p.x())), j = static_cast<int>(std::floor(p.y()));
    const double a = p.x() - i, b = p.y() - j;
    const auto pixel = [&](int column, int row) {
      double sum = 0;
      for (int c = 0; c < 3; ++c) sum += std::pow((samples(3 * column + c, row) / 255.0 + 0.055) / 1.055, 2.4);
      return sum;
    };
    return (1 - b) * ((1 - a) * pixel(i, j) + a * pixel(i + 1, j)) +
           b * ((1 - a) * pixel(i, j + 1) + a * pixel(i + 1, j + 1));
  };
  Eigen::Vector2d moment = Eigen::Vector2d::Zero();
  double mass = 0;
  for (int j = -30; j <= 30; ++j)
    for (int i = -30; i <= 30; ++i) {
      if (i * i + j * j > 900) continue;
      const Eigen::Vector2d offset = 0.1 * std::sqrt(spot_variance_px2) * Eigen::Vector2d(i, j);
      const double weight =
          std::exp(-0.005 * (i * i + j * j)) * light(middle + across * offset.x() + down * offset.y());
      mass += weight;
      moment += weight * offset;
    }
  return moment / mass;
}

/// A camera of a megapixel over an A3 spread, scanned at 300 dpi. Argument: share of the page that is printed, percent.
void weigh(benchmark::State& state) {
  const Rig rig = sim::make_test_rig(1024);
  const sim::AnalyticScene page{[](double x, double) { return 30 + 25 * std::cos(x / 60); }};
  const PointMap points = page.points(rig.cameras[0]);
  const Picture scan = print(*rig.scanner, 0.01 * static_cast<double>(state.range(0)));
  SpotOffsets offsets;
  for (auto _ : state) offsets = weigh_footprints(points, *rig.scanner, linear_light(scan), spot_variance_px2);
  double squares = 0, count = 0, moved = 0, known = 0;
  for (int y = 11; y + 11 < points.height(); ++y)
    for (int x = 11; x + 11 < points.width(); ++x) {
      if (!std::isfinite(offsets.dx(x, y))) continue;
      ++known;
      moved += offsets.dx(x, y) != 0 || offsets.dy(x, y) != 0;
      if (x % 41 != 0 || y % 43 != 0) continue;
      const Eigen::Vector2d fine = fine_middle(points, *rig.scanner, scan, x, y);
      squares += (fine - Eigen::Vector2d(offsets.dx(x, y), offsets.dy(x, y))).squaredNorm();
      ++count;
    }
  state.counters["rms_error_px"] = std::sqrt(squares / count);
  state.counters["share_with_print"] = moved / known;
  state.counters["scan_megapixels"] = 1e-6 * scan.width() * scan.height();
}
BENCHMARK(weigh)->ArgName("printed")->Arg(0)->Arg(30)->Arg(100)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime();

}  // namespace
}  // namespace pagesweep
