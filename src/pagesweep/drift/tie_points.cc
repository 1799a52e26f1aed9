// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/drift/tie_points.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "pagesweep/base/local_plane.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/data/linear_light.h"
#include "pagesweep/drift/align_patch.h"

namespace pagesweep {
namespace {

constexpr int tile_px = 48, tile_step_px = 24;
constexpr int plane_radius_px = 4;       // of the local planes that smooth time and depth
constexpr double farthest_px = 8;        // beside the epipolar curve
constexpr double farthest_mm = 2;        // on the paper, in the scan
constexpr double least_share = 0.6;      // of a tile's pixels with a point
constexpr double most_sigma_px = 0.1;    // of a tie point, in pixels of the second camera
constexpr double along_sigma_px = 0.03;  // of the match by time, smoothed

/// The scan as light, reduced until a pixel is half a pixel of the camera.
struct ReducedScan {
  Image<float> light;
  int factor = 1;
  Eigen::Vector2d reduce(const Eigen::Vector2d& pixel) const { return ((pixel.array() + 0.5) / factor - 0.5).matrix(); }
  Eigen::Vector2d enlarge(const Eigen::Vector2d& shift) const { return factor * shift; }
};

Image<float> box_reduced(const Image<float>& image, int factor) {
  if (factor == 1) return image;
  Image<float> reduced(image.width() / factor, image.height() / factor);
  const float part = 1.0F / static_cast<float>(factor * factor);
  parallel_rows(reduced.height(), [&](int y) {
    for (int j = 0; j < factor; ++j) {
      const auto row = image.row(y * factor + j);
      for (int x = 0; x < reduced.width(); ++x)
        for (int i = 0; i < factor; ++i) reduced(x, y) += part * row[static_cast<std::size_t>(x * factor + i)];
    }
  });
  return reduced;
}

class TieFinder {
 public:
  explicit TieFinder(const SweepView& view) : view_(view) {
    const PointMap& points = view.first_points;
    inverse_depth_ = Image<float>(points.width(), points.height(), not_a_number);
    const auto& cam = view.first.cam_from_rig;
    for (int y = 0; y < points.height(); ++y)
      for (int x = 0; x < points.width(); ++x)
        if (points.status(x, y) == PixelStatus::ok)
          inverse_depth_(x, y) = static_cast<float>(1 / (cam * point_at(x, y)).z());
    amplitude_ = seen_amplitude(view.first_times);
    other_amplitude_ = seen_amplitude(view.second_times);
    if (view.scan && view.rig.scanner) reduce_scan();
  }

  std::vector<TiePoint> run() const {
    const auto tiles = [](int pixels) { return pixels < tile_px ? 0 : (pixels - tile_px) / tile_step_px + 1; };
    const int columns = tiles(amplitude_.width()), rows = tiles(amplitude_.height());
    std::vector<std::optional<TiePoint>> found(static_cast<std::size_t>(columns * rows));
    parallel_ranges(columns * rows, 1, [&](int begin, int end) {
      for (int i = begin; i < end; ++i)
        found[static_cast<std::size_t>(i)] = find((i % columns) * tile_step_px, (i / columns) * tile_step_px);
    });
    std::vector<TiePoint> ties;
    for (const auto& tie : found)
      if (tie) ties.push_back(*tie);
    return ties;
  }

 private:
  Eigen::Vector3d point_at(int x, int y) const {
    const PointMap& points = view_.first_points;
    return {points.x(x, y), points.y(x, y), points.z(x, y)};
  }

  static Image<float> seen_amplitude(const TimeMap& times) {
    Image<float> amplitude(times.width(), times.height(), not_a_number);
    for (std::size_t i = 0; i < amplitude.size(); ++i)
      if (times.status.data()[i] == PixelStatus::ok) amplitude.data()[i] = times.amplitude.data()[i];
    return amplitude;
  }

  void reduce_scan() {
    const Scanner& scanner = *view_.rig.scanner;
    const PointMap& points = view_.first_points;
    std::vector<double> steps;  // [scan pixels] a pixel of the camera
    for (int y = 0; y + 1 < points.height(); y += 16)
      for (int x = 0; x + 1 < points.width(); x += 16) {
        if (points.status(x, y) != PixelStatus::ok || points.status(x + 1, y) != PixelStatus::ok) continue;
        const auto here = scanner.project(point_at(x, y)), beside = scanner.project(point_at(x + 1, y));
        if (here && beside) steps.push_back((*beside - *here).norm());
      }
    if (steps.empty()) return;
    const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
    std::nth_element(steps.begin(), middle, steps.end());
    ReducedScan reduced;
    reduced.factor = std::max(1, static_cast<int>(std::lround(0.5 * *middle)));
    reduced.light = box_reduced(linear_light(*view_.scan), reduced.factor);
    scan_ = std::move(reduced);
  }

  std::optional<TiePoint> find(int left, int top) const {
    const auto pixels = pixels_of(left, top);
    if (static_cast<double>(pixels.size()) < least_share * tile_px * tile_px) return std::nullopt;
    auto tie = middle_of(left, top);
    if (!tie || !look_in_second(left, top, pixels, *tie)) return std::nullopt;
    if (scan_) look_in_scan(left, top, pixels, *tie);
    return tie;
  }

  std::vector<Eigen::Vector2i> pixels_of(int left, int top) const {
    std::vector<Eigen::Vector2i> pixels;
    for (int y = top; y < top + tile_px; ++y)
      for (int x = left; x < left + tile_px; ++x)
        if (view_.first_points.status(x, y) == PixelStatus::ok && std::isfinite(amplitude_(x, y)))
          pixels.push_back({x, y});
    return pixels;
  }

  /// The valid pixel nearest to the tile's middle, its point and time smoothed by local planes.
  std::optional<TiePoint> middle_of(int left, int top) const {
    const Eigen::Vector2i middle(left + tile_px / 2, top + tile_px / 2);
    for (int reach = 0; reach < tile_px / 4; ++reach)
      for (int dy = -reach; dy <= reach; ++dy)
        for (int dx = -reach; dx <= reach; ++dx) {
          if (std::max(std::abs(dx), std::abs(dy)) != reach) continue;
          const int x = middle.x() + dx, y = middle.y() + dy;
          if (!std::isfinite(inverse_depth_(x, y)) || view_.first_times.status(x, y) != PixelStatus::ok) continue;
          if (auto tie = smooth(x, y)) return tie;
        }
    return std::nullopt;
  }

  std::optional<TiePoint> smooth(int x, int y) const {
    const auto depth = fit_plane(inverse_depth_, x, y, plane_radius_px);
    const auto time = fit_plane(view_.first_times.time, x, y, plane_radius_px);
    const auto ray = view_.first.ray({x, y});
    if (!depth || !time || !ray) return std::nullopt;
    TiePoint tie;
    tie.first = {x, y};
    tie.time = view_.first_times.time(x, y) + time->middle;
    const double along_axis = (view_.first.cam_from_rig.rotation * ray->direction).z();
    tie.point = ray->at(1 / (inverse_depth_(x, y) + depth->middle) / along_axis);
    return tie;
  }

  /// \param place  where a pixel's point is expected in the other picture; nothing if nowhere
  template <class Place>
  Patch patch_of(int left, int top, const std::vector<Eigen::Vector2i>& pixels, const Place& place) const {
    Patch patch;
    for (const Eigen::Vector2i& pixel : pixels) {
      const auto expected = place(point_at(pixel.x(), pixel.y()));
      if (!expected) continue;
      patch.gray.push_back(amplitude_(pixel.x(), pixel.y()));
      patch.offset.push_back((pixel.cast<double>() - Eigen::Vector2d(left, top)) / (0.5 * tile_px) -
                             Eigen::Vector2d::Ones());
      patch.place.push_back(*expected);
    }
    return patch;
  }

  bool look_in_second(int left, int top, const std::vector<Eigen::Vector2i>& pixels, TiePoint& tie) const {
    const Camera& camera = view_.second;
    const auto seen = camera.project(tie.point);
    const auto ray = view_.first.ray(tie.first);
    if (!seen || !camera.sees(*seen)) return false;
    const Eigen::Vector2d along = (camera.project_jacobian(tie.point) * ray->direction).normalized();
    const Eigen::Vector2d across(-along.y(), along.x());
    const auto direction = equal_time_direction(*seen, across);
    if (!direction) return false;
    const auto shift =
        align_patch(other_amplitude_,
                    patch_of(left, top, pixels, [&](const Eigen::Vector3d& point) { return camera.project(point); }),
                    {*direction, farthest_px, 0.5});
    if (!shift || !(shift->covariance(0, 0) < most_sigma_px * most_sigma_px)) return false;
    tie.across_px = shift->amount(0);
    tie.across_sigma_px = std::sqrt(shift->covariance(0, 0));
    tie.second = *seen + tie.across_px * *direction;
    tie.second_covariance = shift->covariance(0, 0) * *direction * direction->transpose() +
                            along_sigma_px * along_sigma_px * along * along.transpose();
    return true;
  }

  /// The direction in which the second camera's times do not change, as long as that it leads 1 px across the
  /// epipolar curve: along it a match by equal times is free.
  std::optional<Eigen::Vector2d> equal_time_direction(const Eigen::Vector2d& pixel,
                                                      const Eigen::Vector2d& across) const {
    const TimeMap& times = view_.second_times;
    const int x = static_cast<int>(std::lround(pixel.x())), y = static_cast<int>(std::lround(pixel.y()));
    if (!times.time.contains(x, y) || times.status(x, y) != PixelStatus::ok) return std::nullopt;
    const auto plane = fit_plane(times.time, x, y, plane_radius_px);
    if (!plane) return std::nullopt;
    const Eigen::Vector2d direction(-plane->down, plane->across);
    const double length = direction.dot(across);
    // Nearly along the curve there would be no match to speak of.
    if (!(std::abs(length) > 0.3 * direction.norm())) return std::nullopt;
    return direction / length;
  }

  void look_in_scan(int left, int top, const std::vector<Eigen::Vector2i>& pixels, TiePoint& tie) const {
    const Scanner& scanner = *view_.rig.scanner;
    const auto seen = scanner.project(tie.point);
    if (!seen || !scanner.sees(*seen)) return;
    // The table's plane, nearly the paper's, tells what a shift in the scan is in millimetres.
    const Eigen::Matrix2d scan_by_mm = scanner.project_jacobian(tie.point).leftCols<2>();
    const double pixels_a_mm = std::sqrt(std::abs(scan_by_mm.determinant())) / scan_->factor;
    const auto place = [&](const Eigen::Vector3d& point) -> std::optional<Eigen::Vector2d> {
      const auto pixel = scanner.project(point);
      if (!pixel) return std::nullopt;
      return scan_->reduce(*pixel);
    };
    const double farthest = farthest_mm * pixels_a_mm;
    const auto shift =
        align_patch(scan_->light, patch_of(left, top, pixels, place), {Eigen::Matrix2d::Identity(), farthest, 1});
    if (!shift || !(shift->covariance.trace() < 1)) return;
    const Eigen::Vector2d shift_px = scan_->enlarge(shift->amount);
    tie.scan = {*seen + shift_px, scan_->factor * scan_->factor * shift->covariance, scan_by_mm.inverse() * shift_px};
  }

  const SweepView& view_;
  Image<float> inverse_depth_, amplitude_, other_amplitude_;
  std::optional<ReducedScan> scan_;
};

}  // namespace

std::vector<TiePoint> find_tie_points(const SweepView& view) {
  const auto fits = [](const Camera& camera, const auto& map) {
    return map.width() == camera.width && map.height() == camera.height;
  };
  if (!fits(view.first, view.first_times) || !fits(view.second, view.second_times) ||
      !fits(view.first, view.first_points))
    throw std::invalid_argument("find_tie_points: a map's size is not its camera's");
  return TieFinder(view).run();
}

}  // namespace pagesweep
