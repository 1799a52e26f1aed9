// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/footprint/weigh_footprints.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <tuple>
#include <utility>
#include <vector>

#include "pagesweep/base/local_plane.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/footprint/spot_sums_internal.h"

namespace pagesweep {
namespace {

constexpr float negligible_px = 0.02f;  ///< an offset that no time value would notice

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

/// By how much the place in the scan moves from one pixel of the camera to the next [px], median.
float typical_step(const ScanPositions& positions) {
  std::vector<float> steps;
  for (int y = 0; y + 1 < positions.u.height(); y += 5)
    for (int x = 0; x + 1 < positions.u.width(); x += 5)
      for (const auto& [i, j] : {std::pair{x + 1, y}, {x, y + 1}}) {
        const float step = std::hypot(positions.u(i, j) - positions.u(x, y), positions.v(i, j) - positions.v(x, y));
        if (std::isfinite(step)) steps.push_back(step);
      }
  if (steps.empty()) return 1;
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

/// The scan around one pixel: position(d) = middle + by_pixel d, for places d [px] in the camera's picture.
struct ScanPatch {
  Eigen::Vector2f middle;
  Eigen::Matrix2f by_pixel;
};

/// The patches around pixels of one row; NaN where they are not known.
class Patches {
 public:
  explicit Patches(const ScanPositions& positions) : positions_(positions) {}

  void look(const PlaneBatch& pixels) {
    u_ = v_ = pixels;
    fitter_.fit(positions_.u, u_);
    fitter_.fit(positions_.v, v_);
  }
  ScanPatch operator[](std::size_t k) const {
    const int x = u_.column[k], y = u_.row;
    ScanPatch patch{{positions_.u(x, y) + u_.middle[k], positions_.v(x, y) + v_.middle[k]}, {}};
    patch.by_pixel << u_.across[k], u_.down[k], v_.across[k], v_.down[k];
    return patch;
  }

 private:
  const ScanPositions& positions_;
  PlaneFitter fitter_{2};
  PlaneBatch u_, v_;
};

/// The lowest and highest light around every place of the scan, for a quick answer to whether something is printed.
class Contrast {
 public:
  /// \param reach_px  of the surroundings, at least
  Contrast(const Image<float>& light, float reach_px)
      : side_(std::max(1, static_cast<int>(std::ceil(reach_px / blocks)))),
        low_((light.width() + side_ - 1) / side_, (light.height() + side_ - 1) / side_),
        high_(low_.width(), low_.height()) {
    Image<float> low(low_.width(), low_.height()), high = low;
    parallel_rows(low.height(), [&](int row) {
      for (int column = 0; column < low.width(); ++column)
        std::tie(low(column, row), high(column, row)) = range_of(light, light, column * side_, row * side_, side_);
    });
    parallel_rows(low.height(), [&](int row) {
      for (int column = 0; column < low.width(); ++column)
        std::tie(low_(column, row), high_(column, row)) =
            range_of(low, high, column - blocks, row - blocks, 2 * blocks + 1);
    });
  }

  /// (high - low) / (high + low) of all that lies within reach of a place in the scan, and of a little more.
  float around(const Eigen::Vector2f& place) const {
    const int column = std::clamp(static_cast<int>(place.x()) / side_, 0, low_.width() - 1);
    const int row = std::clamp(static_cast<int>(place.y()) / side_, 0, low_.height() - 1);
    return (high_(column, row) - low_(column, row)) / (high_(column, row) + low_(column, row));
  }

 private:
  static constexpr int blocks = 2;  ///< in reach, on either side

  /// Over a square of pixels, as far as it lies inside.
  static std::pair<float, float> range_of(const Image<float>& low, const Image<float>& high, int left, int top,
                                          int side) {
    std::pair<float, float> range{std::numeric_limits<float>::infinity(), 0};
    for (int y = std::max(0, top); y < std::min(low.height(), top + side); ++y)
      for (int x = std::max(0, left); x < std::min(low.width(), left + side); ++x)
        range = {std::min(range.first, low(x, y)), std::max(range.second, high(x, y))};
    return range;
  }

  int side_;  ///< [px] of a square whose range is known
  Image<float> low_, high_;
};

/// The middle of a spot of this variance [px^2], up to three standard deviations from its centre. NaN if it is not
/// wholly in the scan, or all of it is black, or the camera sees the surface so edge-on that it is no paper.
Eigen::Vector2f middle_of(float variance, const ScanPatch& patch, const Image<float>& light) {
  constexpr float reach = 3, most_elongated = 100;
  const Eigen::Vector2f unknown = Eigen::Vector2f::Constant(not_a_number);
  const float determinant = std::abs(patch.by_pixel.determinant()), size = patch.by_pixel.norm();
  if (!(size * size < most_elongated * determinant)) return unknown;
  const float sigma_px = std::sqrt(variance), narrowest = sigma_px * determinant / size;  // or a little more
  const Eigen::Vector2f extent = reach * sigma_px * patch.by_pixel.rowwise().norm();
  const Eigen::Vector2f low = (patch.middle - extent).array().floor(), high = (patch.middle + extent).array().ceil();
  // Whole vectors are read, up to the row behind the last one.
  if (light.width() < 2 * spot_padding) return unknown;
  const Eigen::Vector2f last(static_cast<float>(light.width() - 1), static_cast<float>(light.height() - 3));
  if (!(low.minCoeff() >= 0 && (last - high).minCoeff() >= 0)) return unknown;
  const Eigen::Vector2f middle = patch.middle - low;
  const Eigen::Matrix2f from_scan = patch.by_pixel.inverse();
  const Eigen::Matrix2f precision = from_scan.transpose() * from_scan / variance;
  const GaussianSpot spot{.u = middle.x(),
                          .v = middle.y(),
                          .uu = precision(0, 0),
                          .uv = precision(0, 1),
                          .vv = precision(1, 1),
                          .most = reach * reach,
                          .columns = static_cast<int>(high.x() - low.x()) + 1,
                          .rows = static_cast<int>(high.y() - low.y()) + 1,
                          .parts = static_cast<int>(std::ceil(std::clamp(1 / narrowest, 1.0f, 16.0f))),
                          .row_step = static_cast<int>(std::max(1.0f, narrowest / 2))};
  const float* corner = &light(static_cast<int>(low.x()), static_cast<int>(low.y()));
  const SpotSums sums = sum_spot({corner, light.width()}, spot);
  return from_scan * Eigen::Vector2f(sums.u, sums.v) / sums.light;
}

}  // namespace

SpotOffsets weigh_footprints(const PointMap& points, const Scanner& scanner, const Image<float>& light,
                             double spot_variance_px2) {
  if (light.width() != scanner.width() || light.height() != scanner.height())
    throw std::invalid_argument("weigh_footprints: the light is not of the scanner's size");
  if (!(spot_variance_px2 > 0)) throw std::invalid_argument("weigh_footprints: the spot's variance must be above 0");
  const ScanPositions positions = project(points, scanner);
  const auto sigma_px = static_cast<float>(std::sqrt(spot_variance_px2));
  const float usual_px = 3 * sigma_px * typical_step(positions);
  const Contrast contrast(light, 1.5f * usual_px);
  SpotOffsets offsets(points.width(), points.height());
  // A sharp edge through the middle would move it by sqrt(2 / pi) sigma contrast: no way to get further.
  const auto matters = [&](const Eigen::Vector2f& place) {
    return !(0.8f * sigma_px * contrast.around(place) < negligible_px);
  };
  constexpr int rows_at_once = 8;
  parallel_ranges(points.height(), rows_at_once, [&](int begin, int end) {
    Patches patches(positions);
    for (int y = begin; y < end; ++y) {
      const auto is_worth_it = [&](int x) {
        const Eigen::Vector2f place(positions.u(x, y), positions.v(x, y));
        if (!std::isfinite(place.x())) return false;
        if (matters(place)) return true;
        offsets.dx(x, y) = offsets.dy(x, y) = 0;
        return false;
      };
      in_batches(points.width(), y, is_worth_it, [&](const PlaneBatch& pixels) {
        patches.look(pixels);
        for (std::size_t k = 0; k < pixels.count; ++k) {
          const Eigen::Vector2f middle = middle_of(static_cast<float>(spot_variance_px2), patches[k], light);
          offsets.dx(pixels.column[k], y) = middle.x();
          offsets.dy(pixels.column[k], y) = middle.y();
        }
      });
    }
  });
  return offsets;
}

}  // namespace pagesweep
