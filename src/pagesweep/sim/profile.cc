// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/sim/profile.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace pagesweep::sim {
namespace {

constexpr double sample_spacing_mm = 0.05;

/// Fritsch and Carlson's slope at an inner point: the weighted harmonic mean of its neighbouring secants.
double inner_derivative(double h0, double h1, double secant0, double secant1) {
  if (secant0 * secant1 <= 0) return 0;
  const double w0 = 2 * h1 + h0, w1 = h1 + 2 * h0;
  return (w0 + w1) / (w0 / secant0 + w1 / secant1);
}

}  // namespace

SlopeCurve::SlopeCurve(std::vector<ProfileSlope> points) : points_(std::move(points)), curvatures_(points_.size()) {
  if (points_.empty()) throw std::invalid_argument("a profile needs at least one slope");
  const auto gap = [&](std::size_t i) { return points_[i + 1].at_mm - points_[i].at_mm; };
  const auto secant = [&](std::size_t i) { return (points_[i + 1].slope_rad - points_[i].slope_rad) / gap(i); };
  for (std::size_t i = 0; i + 1 < points_.size(); ++i) {
    if (!(gap(i) > 0)) throw std::invalid_argument("a profile's slopes must be in ascending order of their places");
    if (i > 0) curvatures_[i] = inner_derivative(gap(i - 1), gap(i), secant(i - 1), secant(i));
  }
}

double SlopeCurve::slope_rad(double at_mm) const {
  if (at_mm <= points_.front().at_mm) return points_.front().slope_rad;
  if (at_mm >= points_.back().at_mm) return points_.back().slope_rad;
  const auto after = std::upper_bound(points_.begin(), points_.end(), at_mm,
                                      [](double at, const ProfileSlope& point) { return at < point.at_mm; });
  const auto i = static_cast<std::size_t>(after - points_.begin() - 1);
  const double h = points_[i + 1].at_mm - points_[i].at_mm, x = (at_mm - points_[i].at_mm) / h;
  const double rest = 1 - x;
  return points_[i].slope_rad * (1 + 2 * x) * rest * rest + points_[i + 1].slope_rad * (1 + 2 * rest) * x * x +
         h * (curvatures_[i] * x * rest * rest - curvatures_[i + 1] * rest * x * x);
}

double SlopeCurve::curvature(double at_mm) const {
  const double h = 1e-4;
  return (slope_rad(at_mm + h) - slope_rad(at_mm - h)) / (2 * h);
}

RulingCurve::RulingCurve(const SlopeCurve& slopes, double apex_mm, double first_mm, double last_mm,
                         const Eigen::Matrix3d& axes)
    : handedness_(axes.determinant() < 0 ? -1 : 1), step_rad_(sample_spacing_mm / apex_mm) {
  // The curve's frame (ruling, across, normal) moves by d ruling = across, d across = -ruling + k normal, d normal =
  // -k across for each radian, k its geodesic curvature: a turn about k ruling + normal in a right-handed frame.
  const int before = static_cast<int>(std::ceil(-first_mm / sample_spacing_mm));
  const int after = static_cast<int>(std::ceil(last_mm / sample_spacing_mm));
  first_rad_ = -before * step_rad_;
  samples_.resize(static_cast<std::size_t>(before + after + 1));
  const double rise = slopes.slope_rad(0);
  Eigen::Matrix3d start;
  start.col(0) = axes.col(0);
  start.col(1) = std::cos(rise) * axes.col(1) + std::sin(rise) * axes.col(2);
  start.col(2) = std::cos(rise) * axes.col(2) - std::sin(rise) * axes.col(1);
  const auto march = [&](int steps, double direction) {
    Eigen::Matrix3d frame = start;
    for (int i = 0; i <= steps; ++i) {
      const double here = direction * i * sample_spacing_mm;
      const double bend = slopes.curvature(here) * apex_mm;
      samples_[static_cast<std::size_t>(before + static_cast<int>(direction) * i)] = {
          frame.col(0), frame.col(1), -frame.col(0) + bend * frame.col(2)};
      // Over a step the frame turns about a fixed axis, with the curvature of the step's middle. The total bend is
      // taken from the slopes themselves, so that it is exact however short a crease is.
      const double next = here + direction * sample_spacing_mm;
      const double turn = slopes.slope_rad(next) - slopes.slope_rad(here);
      const Eigen::Vector3d rotation = handedness_ * (turn * frame.col(0) + direction * step_rad_ * frame.col(2));
      const double angle = rotation.norm();
      if (angle > 0) frame = Eigen::AngleAxisd(angle, rotation / angle).toRotationMatrix() * frame;
    }
  };
  march(before, -1);
  march(after, 1);
}

RulingCurve::Direction RulingCurve::at(double angle_rad) const {
  const double position = std::clamp((angle_rad - first_rad_) / step_rad_, 0.0, double(samples_.size()) - 1.001);
  const auto i = static_cast<std::size_t>(position);
  const double x = position - double(i), rest = 1 - x;
  const Sample &a = samples_[i], &b = samples_[i + 1];
  const auto hermite = [&](const Eigen::Vector3d& p, const Eigen::Vector3d& dp, const Eigen::Vector3d& q,
                           const Eigen::Vector3d& dq) -> Eigen::Vector3d {
    return p + (q - p) * (x * x * (3 - 2 * x)) + step_rad_ * (dp * (x * rest * rest) - dq * (rest * x * x));
  };
  Direction direction;
  direction.ruling = hermite(a.ruling, a.across, b.ruling, b.across).normalized();
  const Eigen::Vector3d across = hermite(a.across, a.bend, b.across, b.bend);
  direction.normal = handedness_ * direction.ruling.cross(across).normalized();
  return direction;
}

}  // namespace pagesweep::sim
