// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

#include "pagesweep/data/page_surface.h"
#include "pagesweep/sim/analytic_scene.h"

/// Surfaces whose flattening is known in closed form, measured as real cameras would, for this directory's tests.
namespace pagesweep::scenes {

/// Counter-based random numbers: the same for a seed and a pixel, whoever asks.
class Noise {
 public:
  explicit Noise(std::uint64_t seed) : seed_(seed) {}
  double uniform(std::uint64_t counter) const {
    std::uint64_t x = (seed_ * 0x9E3779B97F4A7C15u + counter + 1) * 0xBF58476D1CE4E5B9u;
    x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9u;
    x = (x ^ (x >> 27)) * 0x94D049BB133111EBu;
    return static_cast<double>((x ^ (x >> 31)) >> 11) * 0x1p-53;
  }
  double gauss(std::uint64_t counter) const {
    return std::sqrt(-2 * std::log(uniform(2 * counter) + 1e-300)) *
           std::cos(2 * std::numbers::pi * uniform(2 * counter + 1));
  }

 private:
  std::uint64_t seed_;
};

struct Measuring {
  int width_px = 256;
  double noise_mm = 0.08;  ///< along the viewing ray
  double drop = 0.02;      ///< share of pixels without a point
  double outliers = 0;     ///< share of pixels that are wrong by up to 30 mm along the ray
  std::uint64_t seed = 1;
  /// Brightness of a place; 100 if empty.
  std::function<double(double x, double y)> brightness = {};
  /// Whether nothing is measured there.
  std::function<bool(double x, double y)> hole = {};
};

inline std::vector<PointMap> measure(const sim::AnalyticScene& scene, const Measuring& how = {}) {
  const Rig rig = sim::make_test_rig(how.width_px);
  std::vector<PointMap> maps;
  for (const Camera& camera : rig.cameras) {
    PointMap map = scene.points(camera, how.noise_mm);
    const Noise noise(how.seed * 16 + maps.size());
    for (int y = 0; y < map.height(); ++y)
      for (int x = 0; x < map.width(); ++x) {
        if (map.status(x, y) != PixelStatus::ok) continue;
        const auto pixel = static_cast<std::uint64_t>(y) * 65536 + static_cast<std::uint64_t>(x);
        const Eigen::Vector3d point(map.x(x, y), map.y(x, y), map.z(x, y));
        if (how.brightness) map.intensity(x, y) = static_cast<float>(how.brightness(point.x(), point.y()));
        double error = how.noise_mm * noise.gauss(4 * pixel);
        if (noise.uniform(8 * pixel + 5) < how.outliers) error = 60 * (noise.uniform(8 * pixel + 6) - 0.5);
        const Eigen::Vector3d moved = point + error * (point - camera.center()).normalized();
        map.x(x, y) = static_cast<float>(moved.x());
        map.y(x, y) = static_cast<float>(moved.y());
        map.z(x, y) = static_cast<float>(moved.z());
        const bool dropped = noise.uniform(8 * pixel + 7) < how.drop || (how.hole && how.hole(point.x(), point.y()));
        if (!dropped) continue;
        map.x(x, y) = map.y(x, y) = map.z(x, y) = map.sigma(x, y) = not_a_number;
        map.status(x, y) = PixelStatus::saturated;
      }
    maps.push_back(std::move(map));
  }
  return maps;
}

/// A cut given by its direction as a function of the arc length: theta(s). Tabulated by Simpson's rule to 1e-9 mm.
class Cut {
 public:
  Cut(const std::function<double(double s)>& theta, double length_mm) : step_(length_mm / steps) {
    x_.push_back(0);
    z_.push_back(0);
    for (int k = 0; k < steps; ++k) {
      const double s = k * step_;
      const double a = theta(s), b = theta(s + step_ / 2), c = theta(s + step_);
      x_.push_back(x_.back() + step_ / 6 * (std::cos(a) + 4 * std::cos(b) + std::cos(c)));
      z_.push_back(z_.back() + step_ / 6 * (std::sin(a) + 4 * std::sin(b) + std::sin(c)));
    }
  }
  double width() const { return x_.back(); }
  double height(double x) const { return mix(z_, position(x)); }
  double arc(double x) const { return position(x) * step_; }

 private:
  static constexpr int steps = 20000;
  double position(double x) const {
    const auto above = std::upper_bound(x_.begin() + 1, x_.end() - 1, x);
    const auto k = static_cast<std::size_t>(above - x_.begin() - 1);
    return static_cast<double>(k) + (x - x_[k]) / (x_[k + 1] - x_[k]);
  }
  static double mix(const std::vector<double>& table, double position) {
    const auto k = std::min(static_cast<std::size_t>(std::max(0.0, position)), table.size() - 2);
    const double share = position - static_cast<double>(k);
    return (1 - share) * table[k] + share * table[k + 1];
  }
  double step_;
  std::vector<double> x_, z_;
};

/// How well a page's nodes lie on the paper, after the best rigid alignment (rotation and shift, no mirror, no scale).
struct FlatteningError {
  double rms_mm = 0, largest_mm = 0, scale = 0, turn_rad = 0;
  int nodes = 0;
};

/// The distances that the best rigid alignment leaves.
inline FlatteningError align(const std::vector<Eigen::Vector2d>& is, const std::vector<Eigen::Vector2d>& should) {
  FlatteningError error;
  error.nodes = static_cast<int>(is.size());
  Eigen::Vector2d a = Eigen::Vector2d::Zero(), b = a;
  for (std::size_t k = 0; k < is.size(); ++k) {
    a += is[k] / static_cast<double>(is.size());
    b += should[k] / static_cast<double>(is.size());
  }
  double cosine = 0, sine = 0, size = 0;
  for (std::size_t k = 0; k < is.size(); ++k) {
    const Eigen::Vector2d x = is[k] - a, y = should[k] - b;
    cosine += x.dot(y);
    sine += x.x() * y.y() - x.y() * y.x();
    size += y.squaredNorm();
  }
  error.turn_rad = std::atan2(sine, cosine);
  error.scale = std::hypot(cosine, sine) / size;
  const Eigen::Rotation2Dd turn(error.turn_rad);
  for (std::size_t k = 0; k < is.size(); ++k) {
    const double distance = (turn * (is[k] - a) - (should[k] - b)).norm();
    error.rms_mm += distance * distance / static_cast<double>(is.size());
    error.largest_mm = std::max(error.largest_mm, distance);
  }
  error.rms_mm = std::sqrt(error.rms_mm);
  return error;
}

/// Nodes that are not measured do not count.
/// \param paper_from_rig  true paper coordinates (s, t) of the paper spot at (x, y); NaN where there is no paper
inline FlatteningError flattening_error(const PageSurface& page, const Image<Eigen::Vector3f>& nodes,
                                        const std::function<Eigen::Vector2d(double x, double y)>& paper_from_rig) {
  std::vector<Eigen::Vector2d> is, should;
  for (int j = 0; j < page.rows(); ++j)
    for (int i = 0; i < page.columns(); ++i) {
      const Eigen::Vector2d truth = paper_from_rig(nodes(i, j).x(), nodes(i, j).y());
      if (!truth.allFinite() || page.status(i, j) != PixelStatus::ok) continue;
      is.emplace_back(page.s_of(i), page.t_of(j));
      should.push_back(truth);
    }
  return align(is, should);
}

/// An open book: both pages rise from the gutter by 50 degrees and bend over, to 4 degrees downwards at the outer edge.
/// The gutter is the line p = gutter_p, turned by turn_rad against y.
struct OpenBook {
  double turn_rad = 0.03, gutter_p_mm = 4, bottom_mm = 8;
  double page_width_mm = 140, page_height_mm = 200;
  Cut cut{[](double s) { return (54 * std::exp(-s / 25) - 4) * std::numbers::pi / 180; }, 140};

  /// (a, b): across and along the gutter
  Eigen::Vector2d book_from_rig(double x, double y) const {
    return Eigen::Rotation2Dd(-turn_rad) * Eigen::Vector2d(x - gutter_p_mm, y);
  }
  double height(double x, double y) const {
    const Eigen::Vector2d place = book_from_rig(x, y);
    if (std::abs(place.x()) > cut.width() || std::abs(place.y()) > page_height_mm / 2) return not_a_number;
    return bottom_mm + cut.height(std::abs(place.x()));
  }
  sim::AnalyticScene scene() const {
    return {[this](double x, double y) { return height(x, y); }, 50, 5};
  }
  /// Paper coordinates of the left (-1) or right (1) page, s = 0 at the gutter.
  Eigen::Vector2d paper(double x, double y, int side) const {
    const Eigen::Vector2d place = book_from_rig(x, y);
    if (std::isnan(height(x, y)) || place.x() * side < 0) return {not_a_number, not_a_number};
    return {side * cut.arc(std::abs(place.x())), -place.y()};
  }
};

}  // namespace pagesweep::scenes
