// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/evaluation/compare_points.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>

#include "pagesweep/base/parallel.h"

namespace pagesweep {
namespace {

/// Gathered row by row, so that sums and maps do not depend on the number of threads.
struct Tally {
  std::vector<double> distance, along_ray, normalised, fitted;
  double claimed_squares = 0;
  std::size_t claims = 0;
  PointErrors counts;

  void add(const Tally& other) {
    const auto append = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
    append(distance, other.distance);
    append(along_ray, other.along_ray);
    append(normalised, other.normalised);
    append(fitted, other.fitted);
    claimed_squares += other.claimed_squares;
    claims += other.claims;
    counts.page_pixels += other.counts.page_pixels;
    counts.measured += other.counts.measured;
    counts.seen_by_both += other.counts.seen_by_both;
    counts.measured_of_both += other.counts.measured_of_both;
    counts.false_points += other.counts.false_points;
    for (std::size_t s = 0; s < status_count; ++s) counts.missing[s] += other.counts.missing[s];
  }

  PointErrors errors() const {
    PointErrors errors = counts;
    errors.distance = summarise(distance);
    errors.along_ray = summarise(along_ray);
    errors.normalised = summarise(normalised);
    errors.fitted = summarise(fitted);
    if (claims > 0) errors.claimed_rms = std::sqrt(claimed_squares / static_cast<double>(claims));
    return errors;
  }
};

/// The true surface around one pixel as seen from its camera.
struct TrueSpot {
  Eigen::Vector3d point;
  Eigen::Vector3d to_camera;  ///< unit length, along the viewing ray
  Eigen::Vector3d normal;     ///< the viewing direction itself where the neighbours tell none
};

TrueSpot spot_at(const MeasuredView& view, int x, int y, const Eigen::Vector3d& center) {
  TrueSpot spot;
  spot.point = (*view.truth)(x, y).cast<double>();
  spot.to_camera = (center - spot.point).normalized();
  spot.normal = true_normal(*view.truth, x, y, center);
  if (!spot.normal.allFinite()) spot.normal = spot.to_camera;
  return spot;
}

void add_point(const Eigen::Vector3d& measured, float sigma_mm, const TrueSpot& spot, Tally& tally) {
  const Eigen::Vector3d error = measured - spot.point;
  const double along_ray = error.dot(spot.to_camera);
  tally.distance.push_back(error.dot(spot.normal));
  tally.along_ray.push_back(along_ray);
  if (!(sigma_mm > 0) || !std::isfinite(sigma_mm)) return;
  tally.normalised.push_back(along_ray / sigma_mm);
  tally.claimed_squares += std::pow(sigma_mm * spot.normal.dot(spot.to_camera), 2);
  ++tally.claims;
}

/// The true point at a sub-pixel place: bilinear inside the page, the nearest of the four pixels at its edge.
Eigen::Vector3d true_point_at(const TruePoints& truth, const Eigen::Vector2d& pixel) {
  const double x = std::clamp(pixel.x(), 0.0, truth.width() - 1.0);
  const double y = std::clamp(pixel.y(), 0.0, truth.height() - 1.0);
  const int x0 = std::min(static_cast<int>(x), std::max(0, truth.width() - 2));
  const int y0 = std::min(static_cast<int>(y), std::max(0, truth.height() - 2));
  const int x1 = std::min(x0 + 1, truth.width() - 1), y1 = std::min(y0 + 1, truth.height() - 1);
  const double a = x - x0, b = y - y0;
  const Eigen::Vector3d top = (1 - a) * truth(x0, y0).cast<double>() + a * truth(x1, y0).cast<double>();
  const Eigen::Vector3d bottom = (1 - a) * truth(x0, y1).cast<double>() + a * truth(x1, y1).cast<double>();
  const Eigen::Vector3d point = (1 - b) * top + b * bottom;
  if (point.allFinite()) return point;
  return truth(a < 0.5 ? x0 : x1, b < 0.5 ? y0 : y1).cast<double>();
}

bool sees_same_point(const MeasuredView& other, const Eigen::Vector3d& point, double tolerance_mm) {
  const auto pixel = other.camera->project(point);
  if (!pixel || !other.camera->sees(*pixel)) return false;
  return (true_point_at(*other.truth, *pixel) - point).norm() <= tolerance_mm;
}

bool seen_by_another(std::span<const MeasuredView> views, std::size_t self, const Eigen::Vector3d& point,
                     double tolerance_mm) {
  for (std::size_t other = 0; other < views.size(); ++other)
    if (other != self && sees_same_point(views[other], point, tolerance_mm)) return true;
  return false;
}

void count_page_pixel(PixelStatus status, bool is_seen_by_both, PointErrors& counts) {
  const bool is_measured = status == PixelStatus::ok;
  ++counts.page_pixels;
  counts.measured += is_measured;
  if (!is_seen_by_both) return;
  ++counts.seen_by_both;
  counts.measured_of_both += is_measured;
  if (!is_measured) ++counts.missing[std::min(static_cast<std::size_t>(status), status_count - 1)];
}

Tally compare_row(std::span<const MeasuredView> views, std::size_t self, int y, const PointComparisonOptions& options,
                  Image<float>& error_map) {
  const MeasuredView& view = views[self];
  const Eigen::Vector3d center = view.camera->center();
  const PointMap& map = *view.points;
  Tally tally;
  for (int x = 0; x < map.width(); ++x) {
    const Eigen::Vector3d measured = Eigen::Vector3f(map.x(x, y), map.y(x, y), map.z(x, y)).cast<double>();
    const bool is_measured = map.status(x, y) == PixelStatus::ok && measured.allFinite();
    if (!(*view.truth)(x, y).allFinite()) {
      tally.counts.false_points += is_measured;
      continue;
    }
    const TrueSpot spot = spot_at(view, x, y, center);
    count_page_pixel(map.status(x, y), seen_by_another(views, self, spot.point, options.same_point_mm), tally.counts);
    if (!is_measured) continue;
    add_point(measured, map.sigma(x, y), spot, tally);
    error_map(x, y) = static_cast<float>(tally.distance.back());
    if (x % options.fit_step_px != 0 || y % options.fit_step_px != 0) continue;
    if (const auto fit = fit_locally(map, x, y, center, options.neighbourhood_mm, options.local_fit))
      tally.fitted.push_back((*fit - spot.point).dot(spot.normal));
  }
  return tally;
}

void check(std::span<const MeasuredView> views, bool with_points) {
  for (const MeasuredView& view : views) {
    if (!view.camera || !view.truth || (with_points && !view.points))
      throw std::invalid_argument("compare_points: a view needs a camera, points and the true points");
    const bool points_fit =
        !with_points || (view.points->width() == view.truth->width() && view.points->height() == view.truth->height());
    if (!points_fit || view.truth->width() != view.camera->width || view.truth->height() != view.camera->height)
      throw std::invalid_argument("compare_points: points, true points and camera differ in size");
  }
}

}  // namespace

double PointErrors::completeness() const {
  return seen_by_both == 0 ? ErrorSummary::none
                           : static_cast<double>(measured_of_both) / static_cast<double>(seen_by_both);
}

double PointErrors::measured_of_page() const {
  return page_pixels == 0 ? ErrorSummary::none : static_cast<double>(measured) / static_cast<double>(page_pixels);
}

Eigen::Vector3d true_normal(const TruePoints& truth, int x, int y, const Eigen::Vector3d& camera_center) {
  const Eigen::Vector3d here = truth(x, y).cast<double>();
  // At a page's edge or a step in depth only the nearer neighbour lies on the same surface.
  const auto tangent = [&](int dx, int dy) -> Eigen::Vector3d {
    const auto neighbour = [&](int sign) -> Eigen::Vector3d {
      if (!truth.contains(x + sign * dx, y + sign * dy)) return Eigen::Vector3d::Constant(not_a_number);
      return sign * (truth(x + sign * dx, y + sign * dy).cast<double>() - here);
    };
    const Eigen::Vector3d ahead = neighbour(1), behind = neighbour(-1);
    if (!behind.allFinite()) return ahead;
    if (!ahead.allFinite()) return behind;
    constexpr double step_ratio = 3;
    if (ahead.norm() > step_ratio * behind.norm()) return behind;
    if (behind.norm() > step_ratio * ahead.norm()) return ahead;
    return 0.5 * (ahead + behind);
  };
  const Eigen::Vector3d normal = tangent(1, 0).cross(tangent(0, 1)).normalized();
  return normal.dot(camera_center - here) < 0 ? Eigen::Vector3d(-normal) : normal;
}

PointComparison compare_points(std::span<const MeasuredView> views, const PointComparisonOptions& options) {
  check(views, true);
  if (options.fit_step_px < 1) throw std::invalid_argument("compare_points: fit_step_px must be at least 1");
  PointComparison comparison;
  Tally all;
  for (std::size_t self = 0; self < views.size(); ++self) {
    const int height = views[self].points->height();
    Image<float> error_map(views[self].points->width(), height, not_a_number);
    std::vector<Tally> rows(static_cast<std::size_t>(height));
    parallel_rows(height,
                  [&](int y) { rows[static_cast<std::size_t>(y)] = compare_row(views, self, y, options, error_map); });
    Tally camera;
    for (const Tally& row : rows) camera.add(row);
    comparison.cameras.push_back(camera.errors());
    comparison.error_maps.push_back(std::move(error_map));
    all.add(camera);
  }
  comparison.all = all.errors();
  return comparison;
}

PointErrors compare_cloud(std::span<const Eigen::Vector3f> cloud, std::span<const float> sigma,
                          std::span<const MeasuredView> views) {
  check(views, false);
  if (!sigma.empty() && sigma.size() != cloud.size())
    throw std::invalid_argument("compare_cloud: there must be one sigma a point, or none");
  Tally tally;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Eigen::Vector3d point = cloud[i].cast<double>();
    std::optional<TrueSpot> best;
    for (const MeasuredView& view : views) {
      const auto pixel = point.allFinite() ? view.camera->project(point) : std::nullopt;
      if (!pixel || !view.camera->sees(*pixel)) continue;
      const int x = std::clamp(static_cast<int>(std::lround(pixel->x())), 0, view.truth->width() - 1);
      const int y = std::clamp(static_cast<int>(std::lround(pixel->y())), 0, view.truth->height() - 1);
      if (!(*view.truth)(x, y).allFinite()) continue;
      const TrueSpot spot = spot_at(view, x, y, view.camera->center());
      const auto distance = [&](const TrueSpot& to) { return std::abs((point - to.point).dot(to.normal)); };
      if (!best || distance(spot) < distance(*best)) best = spot;
    }
    if (best)
      add_point(point, sigma.empty() ? not_a_number : sigma[i], *best, tally);
    else
      ++tally.counts.false_points;
  }
  return tally.errors();
}

}  // namespace pagesweep
