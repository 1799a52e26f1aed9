// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/footprint/weigh_footprints.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <vector>

#include "pagesweep/base/local_plane.h"
#include "pagesweep/base/parallel.h"

namespace pagesweep {
namespace {

/// Light of an sRGB sample between 0 and 1 (IEC 61966-2-1).
float light_of(double sample) {
  return static_cast<float>(sample <= 0.04045 ? sample / 12.92 : std::pow((sample + 0.055) / 1.055, 2.4));
}

/// The scan as light: mean of its channels.
Image<float> light_of(const Picture& scan) {
  Image<float> light(scan.width(), scan.height());
  std::visit(
      [&](const auto& samples) {
        const int highest = std::numeric_limits<std::decay_t<decltype(samples(0, 0))>>::max();
        std::vector<float> table(static_cast<std::size_t>(highest) + 1);
        for (int i = 0; i <= highest; ++i)
          table[static_cast<std::size_t>(i)] =
              light_of(static_cast<double>(i) / highest) / static_cast<float>(scan.channels);
        parallel_rows(scan.height(), [&](int y) {
          for (int x = 0; x < scan.width(); ++x)
            for (int c = 0; c < scan.channels; ++c) light(x, y) += table[samples(x * scan.channels + c, y)];
        });
      },
      scan.samples);
  return light;
}

/// Where the scanner sees the points [px].
struct ScanPositions {
  Image<float> u, v;
};

ScanPositions project(const PointMap& points, const Scanner& scanner) {
  ScanPositions positions{Image<float>(points.width(), points.height(), not_a_number),
                          Image<float>(points.width(), points.height(), not_a_number)};
  parallel_rows(points.height(), [&](int y) {
    for (int x = 0; x < points.width(); ++x) {
      if (points.status(x, y) != PixelStatus::ok) continue;
      const auto seen = scanner.project({points.x(x, y), points.y(x, y), points.z(x, y)});
      if (!seen || !scanner.sees(*seen)) continue;
      positions.u(x, y) = static_cast<float>(seen->x());
      positions.v(x, y) = static_cast<float>(seen->y());
    }
  });
  return positions;
}

/// The scan around one pixel: position(d) = middle + by_pixel d, for places d [px] in the camera's picture.
struct ScanPatch {
  Eigen::Vector2f middle;
  Eigen::Matrix2f by_pixel;
};

std::optional<ScanPatch> patch_around(const ScanPositions& positions, Neighbourhood& around, int x, int y) {
  constexpr int radius = 2;
  if (!std::isfinite(positions.u(x, y))) return std::nullopt;
  around.gather(positions.u, x, y, radius);
  const auto u = around.fit_robustly();
  around.gather(positions.v, x, y, radius);
  const auto v = around.fit_robustly();
  if (!u || !v) return std::nullopt;
  ScanPatch patch{{positions.u(x, y) + u->middle, positions.v(x, y) + v->middle}, {}};
  patch.by_pixel << u->across, u->down, v->across, v->down;
  return patch;
}

/// Places on a disc of three standard deviations, and their weights.
struct Spot {
  struct Place {
    Eigen::Vector2f offset_px;
    float weight;
  };
  std::vector<Place> places;

  explicit Spot(double variance_px2) {
    constexpr int steps = 6;  // on either side: half a standard deviation apart
    const auto step = static_cast<float>(0.5 * std::sqrt(variance_px2));
    for (int j = -steps; j <= steps; ++j)
      for (int i = -steps; i <= steps; ++i)
        if (const int square = i * i + j * j; square <= steps * steps)
          places.push_back({Eigen::Vector2f(i, j) * step, std::exp(-0.125f * static_cast<float>(square))});
  }
};

/// Bilinear; NaN outside.
float sample(const Image<float>& light, const Eigen::Vector2f& position) {
  const float left = std::floor(position.x()), top = std::floor(position.y());
  if (!(left >= 0 && top >= 0 && left < static_cast<float>(light.width() - 1) &&
        top < static_cast<float>(light.height() - 1)))
    return not_a_number;
  const float a = position.x() - left, b = position.y() - top;
  const float* upper = &light(static_cast<int>(left), static_cast<int>(top));
  const float* lower = upper + light.width();
  const float above = upper[0] + a * (upper[1] - upper[0]), below = lower[0] + a * (lower[1] - lower[0]);
  return above + b * (below - above);
}

/// NaN if a place is outside the scan or all of them are black.
Eigen::Vector2f middle_of(const Spot& spot, const ScanPatch& patch, const Image<float>& light) {
  Eigen::Vector2f moment = Eigen::Vector2f::Zero();
  float mass = 0;
  for (const Spot::Place& place : spot.places) {
    const float weight = place.weight * sample(light, patch.middle + patch.by_pixel * place.offset_px);
    mass += weight;
    moment += weight * place.offset_px;
  }
  return moment / mass;
}

}  // namespace

SpotOffsets weigh_footprints(const PointMap& points, const Scanner& scanner, const Picture& scan,
                             double spot_variance_px2) {
  if (scan.width() != scanner.width() || scan.height() != scanner.height())
    throw std::invalid_argument("weigh_footprints: the picture is not of the scanner's size");
  if (!(spot_variance_px2 > 0)) throw std::invalid_argument("weigh_footprints: the spot's variance must be above 0");
  const Image<float> light = light_of(scan);
  const ScanPositions positions = project(points, scanner);
  const Spot spot(spot_variance_px2);
  SpotOffsets offsets(points.width(), points.height());
  parallel_rows(points.height(), [&](int y) {
    Neighbourhood around;
    for (int x = 0; x < points.width(); ++x) {
      const auto patch = patch_around(positions, around, x, y);
      if (!patch) continue;
      const Eigen::Vector2f middle = middle_of(spot, *patch, light);
      offsets.dx(x, y) = middle.x();
      offsets.dy(x, y) = middle.y();
    }
  });
  return offsets;
}

}  // namespace pagesweep
