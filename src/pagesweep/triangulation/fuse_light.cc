// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/triangulation/fuse_light.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <vector>

#include "pagesweep/base/local_plane.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/triangulation/light_section.h"

namespace pagesweep {
namespace {

/// By how much the times of a camera's pixels are late against the sheet of light at their stereo points. It takes up
/// what the sheet's model misses, and light that comes from a facing page. A tile's value is the weighted median of its
/// pixels; between the tiles' middles they are interpolated, each with the weight of its pixels: what dark
/// pixels beside bright ones seem to say is the bright ones' stray light.
class Lateness {
 public:
  /// \param only    pixels that are asked for; null: all
  /// \param stereo  pixels that say something; null: all
  Lateness(const PointMap& points, const TimeMap& times, const SeenLight& light, const PixelSet* only,
           const PixelSet* stereo)
      : tiles_((times.width() + tile - 1) / tile, (times.height() + tile - 1) / tile) {
    const std::vector<std::uint8_t> matters = rows_near(only);
    parallel_rows(tiles_.height(), [&](int row) {
      if (!matters[static_cast<std::size_t>(row)]) return;
      std::vector<Voice> voices;
      for (int column = 0; column < tiles_.width(); ++column) {
        gather(points, times, light, stereo, column, row, voices);
        tiles_(column, row) = weighted_median(voices);
      }
    });
    for (int ring = 0; ring < reach; ++ring) spread();
  }

  /// [frames]; NaN far from all stereo points.
  double at(int x, int y) const {
    const double u = std::clamp((x + 0.5) / tile - 0.5, 0.0, tiles_.width() - 1.0);
    const double v = std::clamp((y + 0.5) / tile - 0.5, 0.0, tiles_.height() - 1.0);
    const int left = static_cast<int>(u), top = static_cast<int>(v);
    const int right = std::min(left + 1, tiles_.width() - 1), bottom = std::min(top + 1, tiles_.height() - 1);
    const double a = u - left, b = v - top;
    double sum = 0, weights = 0;
    const auto add = [&](int column, int row, double near) {
      const Voice& voice = tiles_(column, row);
      const double weight = (near + 1e-6) * voice.weight;
      sum += weight * voice.late;
      weights += weight;
    };
    add(left, top, (1 - a) * (1 - b));
    add(right, top, a * (1 - b));
    add(left, bottom, (1 - a) * b);
    add(right, bottom, a * b);
    return sum / weights;
  }

 private:
  static constexpr int tile = 8;    // [px]
  static constexpr int reach = 12;  // [tiles] from the nearest stereo points

  struct Voice {
    float late = 0;    ///< [frames]
    float weight = 0;  ///< [1/frames^2]
  };

  /// Which rows of tiles have a say in pixels of the set.
  std::vector<std::uint8_t> rows_near(const PixelSet* set) const {
    std::vector<std::uint8_t> near(static_cast<std::size_t>(tiles_.height()), set == nullptr);
    for (int y = 0; set && y < set->height(); ++y)
      if (any_takes_part(set, y))
        for (int row = std::max(0, y / tile - reach - 1); row <= std::min(y / tile + reach + 1, tiles_.height() - 1);
             ++row)
          near[static_cast<std::size_t>(row)] = 1;
    return near;
  }

  static void gather(const PointMap& points, const TimeMap& times, const SeenLight& light, const PixelSet* stereo,
                     int column, int row, std::vector<Voice>& voices) {
    voices.clear();
    const int right = std::min((column + 1) * tile, times.width()), bottom = std::min((row + 1) * tile, times.height());
    for (int y = row * tile; y < bottom; ++y)
      for (int x = column * tile; x < right; ++x) {
        if (!takes_part(stereo, x, y) || points.status(x, y) != PixelStatus::ok) continue;
        const auto time = light.time_of({points.x(x, y), points.y(x, y), points.z(x, y)}, times.time(x, y));
        if (time)
          voices.push_back({static_cast<float>(times.time(x, y) - *time), 1 / (times.sigma(x, y) * times.sigma(x, y))});
      }
  }

  static Voice weighted_median(std::vector<Voice>& voices) {
    if (voices.size() < 4) return {};
    std::ranges::sort(voices, {}, &Voice::late);
    float all = 0, below = 0;
    for (const Voice& voice : voices) all += voice.weight;
    for (const Voice& voice : voices)
      if ((below += voice.weight) >= 0.5f * all) return {voice.late, all};
    return {};
  }

  /// Tiles without stereo points take what those around say, with little weight.
  void spread() {
    const Image<Voice> before = tiles_;
    for (int row = 0; row < tiles_.height(); ++row)
      for (int column = 0; column < tiles_.width(); ++column) {
        if (before(column, row).weight > 0) continue;
        Voice sum;
        for (int j = -1; j <= 1; ++j)
          for (int i = -1; i <= 1; ++i) {
            if (!before.contains(column + i, row + j)) continue;
            const Voice& voice = before(column + i, row + j);
            sum.late += voice.weight * voice.late;
            sum.weight += voice.weight;
          }
        if (sum.weight > 0) tiles_(column, row) = {sum.late / sum.weight, 0.01f * sum.weight};
      }
  }

  Image<Voice> tiles_;
};

/// A distance along a viewing ray and its variance.
struct Estimate {
  double distance_mm, variance_mm2;
};

/// The best linear mean of two estimates of one distance whose errors have that covariance (Gauss and Markov).
Estimate weigh(const Estimate& a, const Estimate& b, double covariance) {
  const double variance = a.variance_mm2 + b.variance_mm2 - 2 * covariance;
  const double weight = std::clamp((a.variance_mm2 - covariance) / variance, 0.0, 1.0);
  const double rest = 1 - weight;
  return {rest * a.distance_mm + weight * b.distance_mm,
          rest * rest * a.variance_mm2 + weight * weight * b.variance_mm2 + 2 * rest * weight * covariance};
}

/// Whether a pixel without a stereo point may be measured by its time alone.
bool may_be_sectioned(PixelStatus status) {
  switch (status) {
    case PixelStatus::outside_view:
    case PixelStatus::no_match:
    case PixelStatus::ambiguous:
    case PixelStatus::inconsistent:
    case PixelStatus::rays_miss:
    case PixelStatus::off_surface:
      return true;
    default:
      return false;
  }
}

class Fusion {
 public:
  Fusion(const PointMap& points, const Correspondences& matches, const TimeMap& times, const RayTable& camera,
         const Light& light, const TriangulationOptions& options, const PixelSet* only, const PixelSet* stereo)
      : matches_(matches),
        times_(times),
        rays_(camera),
        options_(options),
        center_(camera.camera().center()),
        rig_from_cam_(camera.camera().cam_from_rig.rotation.transpose()),
        light_(light, center_),
        lateness_(points, times, light_, only, stereo) {}

  void put_row(PointMap& points, int y, const PixelSet* only, PlaneFitter& around, FusionCounts& counts) const {
    std::array<Estimate, PlaneBatch::most> sheets;
    std::size_t asked = 0;
    const auto is_asked = [&](int x) {
      const auto sheet = takes_part(only, x, y) ? put(points, x, y, counts) : std::nullopt;
      if (sheet) sheets[asked++] = *sheet;
      return sheet.has_value();
    };
    in_batches(rays_.width(), y, is_asked, [&](PlaneBatch& planes) {
      around.fit(times_.time, planes);
      const auto inside = around.are_one_surface(times_.sigma, planes);
      for (std::size_t k = 0; k < planes.count; ++k) decide(points, planes.column[k], y, inside[k], sheets[k], counts);
      asked = 0;
    });
  }

 private:
  Eigen::Vector3d direction_of(int x, int y) const { return rig_from_cam_ * rays_.direction(x, y).homogeneous(); }

  /// \return what the sheet says if it alone decides, should the pixel lie inside a surface
  std::optional<Estimate> put(PointMap& points, int x, int y, FusionCounts& counts) const {
    const bool matched = points.status(x, y) == PixelStatus::ok;
    if (times_.status(x, y) != PixelStatus::ok || !(matched || may_be_sectioned(points.status(x, y))))
      return std::nullopt;
    const double late = lateness_.at(x, y);
    if (!std::isfinite(late)) return std::nullopt;
    const Eigen::Vector3d direction = direction_of(x, y);
    const double length = direction.norm();
    const Ray ray{center_, direction / length};
    const LightSection met = light_.section(ray.direction, times_.time(x, y) - late);
    if (!(met.distance_mm > 0 && std::isfinite(met.distance_mm))) return std::nullopt;
    const double sigma_mm = times_.sigma(x, y) * met.mm_per_frame;
    const Estimate sheet{met.distance_mm, sigma_mm * sigma_mm};
    if (matched && fuse(points, x, y, ray, met, sheet, counts)) return std::nullopt;
    const double depth = sheet.distance_mm / length, half_pixel_mm = 0.5 * depth / rays_.camera().fx;
    // Where the sheet alone decides, it must know the distance better than half of what a pixel sees.
    if (sheet.variance_mm2 < half_pixel_mm * half_pixel_mm && (matched || is_allowed(depth))) return sheet;
    if (matched) reject(points, x, y);
    return std::nullopt;
  }

  bool is_allowed(double depth) const {
    return !(depth < options_.near_mm || (options_.far_mm > 0 && depth > options_.far_mm));
  }

  /// At a step in depth a pixel's time may be that of neither surface.
  void decide(PointMap& points, int x, int y, bool is_inside_a_surface, const Estimate& sheet,
              FusionCounts& counts) const {
    const bool matched = points.status(x, y) == PixelStatus::ok;
    if (!is_inside_a_surface) {
      if (matched) reject(points, x, y);
      return;
    }
    ++(matched ? counts.corrected : counts.added);
    set(points, x, y, {center_, direction_of(x, y).normalized()}, sheet);
  }

  /// \return whether it is settled; if not, the sheet contradicts the match
  bool fuse(PointMap& points, int x, int y, const Ray& ray, const LightSection& met, const Estimate& sheet,
            FusionCounts& counts) const {
    const Eigen::Vector3d point(points.x(x, y), points.y(x, y), points.z(x, y));
    const double sigma = points.sigma(x, y);
    const Estimate stereo{(point - ray.origin).dot(ray.direction), sigma * sigma};
    // The pixel's time being late by e moves the stereo point by e / (d time_2 / d distance), the other by its speed e.
    // What the match moves by along its curve moves the point as much as both sigmas tell.
    const double stereo_mm_per_frame = -sigma / (static_cast<double>(matches_.slope(x, y)) * matches_.sigma(x, y));
    const double time_sigma = times_.sigma(x, y);
    const double covariance = time_sigma * time_sigma * met.mm_per_frame * stereo_mm_per_frame;
    const double difference_variance = stereo.variance_mm2 + sheet.variance_mm2 - 2 * covariance;
    if (!(difference_variance > 0)) return true;
    const double difference = sheet.distance_mm - stereo.distance_mm;
    if (difference * difference > 36 * difference_variance) return false;
    ++counts.weighted;
    set(points, x, y, ray, weigh(stereo, sheet, covariance));
    return true;
  }

  static void reject(PointMap& points, int x, int y) {
    points.x(x, y) = points.y(x, y) = points.z(x, y) = points.sigma(x, y) = not_a_number;
    points.status(x, y) = PixelStatus::off_surface;
  }

  static void set(PointMap& points, int x, int y, const Ray& ray, const Estimate& estimate) {
    const Eigen::Vector3f point = ray.at(estimate.distance_mm).cast<float>();
    points.x(x, y) = point.x();
    points.y(x, y) = point.y();
    points.z(x, y) = point.z();
    points.sigma(x, y) = static_cast<float>(std::sqrt(estimate.variance_mm2));
    points.status(x, y) = PixelStatus::ok;
  }

  const Correspondences& matches_;
  const TimeMap& times_;
  const RayTable& rays_;
  const TriangulationOptions& options_;
  const Eigen::Vector3d center_;
  const Eigen::Matrix3d rig_from_cam_;
  const SeenLight light_;
  const Lateness lateness_;
};

}  // namespace

FusionCounts& FusionCounts::operator+=(const FusionCounts& more) {
  weighted += more.weighted;
  corrected += more.corrected;
  added += more.added;
  return *this;
}

FusionCounts fuse_light(PointMap& points, const Correspondences& matches, const TimeMap& times, const RayTable& camera,
                        const Light& light, const TriangulationOptions& options, const PixelSet* only,
                        const PixelSet* stereo) {
  const auto fits = [&](int width, int height) { return width == camera.width() && height == camera.height(); };
  if (!fits(points.width(), points.height()) || !fits(matches.width(), matches.height()) ||
      !fits(times.width(), times.height()))
    throw std::invalid_argument("fuse_light: points, matches or times are not of the camera's size");
  const Fusion fusion(points, matches, times, camera, light, options, only, stereo);
  std::vector<FusionCounts> rows(static_cast<std::size_t>(camera.height()));
  constexpr int rows_at_once = 8, radius = 2;
  parallel_ranges(camera.height(), rows_at_once, [&](int begin, int end) {
    PlaneFitter around(radius);
    for (int y = begin; y < end; ++y)
      if (any_takes_part(only, y)) fusion.put_row(points, y, only, around, rows[static_cast<std::size_t>(y)]);
  });
  FusionCounts all;
  for (const FusionCounts& row : rows) all += row;
  return all;
}

}  // namespace pagesweep
