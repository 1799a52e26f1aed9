// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/triangulation/triangulate.h"

#include <array>
#include <stdexcept>

#include "pagesweep/base/parallel.h"
#include "pagesweep/triangulation/ray_batch_internal.h"

namespace pagesweep {
namespace {

/// What is needed to triangulate rows of pixels. Holds scratch memory: one a thread.
class Triangulator {
 public:
  Triangulator(const RayTable& from, const RayTable& to, const TriangulationOptions& options)
      : pair_(from.camera(), to.camera()), from_(from), to_(to), options_(options) {}

  void put_row(const Correspondences& matches, int y, const PixelSet* only, PointMap& points) {
    rays_.count = 0;
    for (int x = 0; x < matches.width(); ++x) {
      if (!takes_part(only, x, y)) continue;
      points.status(x, y) = matches.status(x, y);
      if (matches.status(x, y) != PixelStatus::ok) continue;
      add(x, from_.direction(x, y), to_.direction_at({matches.u(x, y), matches.v(x, y)}));
      if (rays_.count == RayBatch::most) put_batch(matches, y, points);
    }
    put_batch(matches, y, points);
  }

 private:
  void add(int x, const Eigen::Vector2d& first, const Eigen::Vector2d& second) {
    const std::size_t k = rays_.count++;
    columns_[k] = x;
    rays_.first_x[k] = first.x();
    rays_.first_y[k] = first.y();
    rays_.second_x[k] = second.x();
    rays_.second_y[k] = second.y();
  }

  void put_batch(const Correspondences& matches, int y, PointMap& points) {
    intersect(pair_, rays_);
    for (std::size_t k = 0; k < rays_.count; ++k) {
      const int x = columns_[k];
      points.status(x, y) = status_of(k);
      if (points.status(x, y) != PixelStatus::ok) continue;
      points.x(x, y) = static_cast<float>(rays_.x[k]);
      points.y(x, y) = static_cast<float>(rays_.y[k]);
      points.z(x, y) = static_cast<float>(rays_.z[k]);
      points.sigma(x, y) = static_cast<float>(matches.sigma(x, y) / rays_.pixels_per_mm[k]);
    }
    rays_.count = 0;
  }

  PixelStatus status_of(std::size_t k) {
    const double depth = rays_.depth[k];
    if (!(depth > 0) || !is_valid_at(rays_.radius_squared[k])) return PixelStatus::rays_miss;
    if (!(rays_.gap_px[k] <= options_.max_ray_gap_px)) return PixelStatus::rays_miss;
    const bool outside = depth < options_.near_mm || (options_.far_mm > 0 && depth > options_.far_mm);
    return outside ? PixelStatus::outside_depth : PixelStatus::ok;
  }

  /// Whether the other camera images what is so far off its axis. What is valid at a radius is valid within.
  bool is_valid_at(double radius_squared) {
    if (radius_squared > known_as_valid_ && to_.camera().distortion.is_valid_at(radius_squared))
      known_as_valid_ = radius_squared;
    return radius_squared <= known_as_valid_;
  }

  RayPair pair_;
  const RayTable& from_;
  const RayTable& to_;
  const TriangulationOptions& options_;
  RayBatch rays_;
  std::array<int, RayBatch::most> columns_{};
  double known_as_valid_ = -1;
};

}  // namespace

void triangulate(const Correspondences& matches, const RayTable& from, const RayTable& to,
                 const TriangulationOptions& options, PointMap& points, const PixelSet* only) {
  const auto fits = [&](const auto& map) { return map.width() == from.width() && map.height() == from.height(); };
  if (!fits(matches) || !fits(points))
    throw std::invalid_argument("triangulate: matches or points are not of the camera's size");
  parallel_ranges(from.height(), 16, [&](int begin, int end) {
    Triangulator triangulator(from, to, options);
    for (int y = begin; y < end; ++y)
      if (any_takes_part(only, y)) triangulator.put_row(matches, y, only, points);
  });
}

PointMap triangulate(const Correspondences& matches, const Image<float>& intensity, const RayTable& from,
                     const RayTable& to, const TriangulationOptions& options) {
  if (!intensity.empty() && (intensity.width() != from.width() || intensity.height() != from.height()))
    throw std::invalid_argument("triangulate: the intensity is not of the camera's size");
  PointMap points(from.width(), from.height());
  triangulate(matches, from, to, options, points, nullptr);
  if (!intensity.empty()) points.intensity = intensity;
  return points;
}

}  // namespace pagesweep
