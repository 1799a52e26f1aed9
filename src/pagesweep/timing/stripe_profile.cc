// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/stripe_profile.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

namespace pagesweep {
namespace {

/// The first and last coefficients are held at 0, so that the spline leaves 0 with slope and curvature 0.
constexpr int held = 3;

/// The four basis functions that are not 0 between two knots, at u = 0..1.
std::array<double, 4> basis(double u) {
  const double v = 1 - u;
  return {v * v * v / 6, (3 * u * u * u - 6 * u * u + 4) / 6, (3 * v * v * v - 6 * v * v + 4) / 6, u * u * u / 6};
}

/// Adds smoothing * |third differences|^2 of the coefficients to the normal equations.
void add_roughness(Eigen::MatrixXd& normal, double smoothing) {
  constexpr std::array<double, 4> difference{-1, 3, -3, 1};
  for (int first = 0; first + 3 < normal.rows(); ++first)
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j)
        normal(first + i, first + j) +=
            smoothing * difference[static_cast<std::size_t>(i)] * difference[static_cast<std::size_t>(j)];
}

}  // namespace

StripeProfile StripeProfile::fit(std::span<const Point> points, double begin, double end, double spacing,
                                 double smoothing) {
  const int pieces = static_cast<int>(std::ceil((end - begin) / spacing - 1e-9));
  if (!(spacing > 0) || pieces < 2 * held)
    throw std::invalid_argument("StripeProfile::fit: the support needs more knots");
  const int count = pieces + 3;
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(count, count);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(count);
  for (const Point& point : points) {
    const double x = (point.time - begin) / spacing;
    if (!(x >= 0 && x < pieces)) continue;
    const int first = static_cast<int>(x);
    const std::array<double, 4> b = basis(x - first);
    for (int i = 0; i < 4; ++i) {
      const double weighted = point.weight * b[static_cast<std::size_t>(i)];
      right(first + i) += weighted * point.value;
      for (int j = 0; j < 4; ++j) normal(first + i, first + j) += weighted * b[static_cast<std::size_t>(j)];
    }
  }
  add_roughness(normal, smoothing * std::max(normal.trace() / count, 1e-300));
  const int free = count - 2 * held;
  Eigen::VectorXd coefficients = Eigen::VectorXd::Zero(count);
  coefficients.segment(held, free) = normal.block(held, held, free, free).ldlt().solve(right.segment(held, free));

  StripeProfile profile;
  profile.begin_ = begin;
  profile.spacing_ = spacing;
  profile.knots_per_frame_ = 1 / spacing;
  profile.set_coefficients({coefficients.data(), static_cast<std::size_t>(count)});
  profile.normalise();
  profile.measure_width();
  return profile;
}

void StripeProfile::set_coefficients(std::span<const double> c) {
  pieces_.resize(c.size() - 3);
  count_ = static_cast<double>(pieces_.size());
  for (std::size_t i = 0; i < pieces_.size(); ++i)
    pieces_[i] = {(c[i] + 4 * c[i + 1] + c[i + 2]) / 6, (c[i + 2] - c[i]) / 2, (c[i] - 2 * c[i + 1] + c[i + 2]) / 2,
                  (c[i + 3] - c[i] + 3 * (c[i + 1] - c[i + 2])) / 6};
}

void StripeProfile::normalise() {
  double height = 0;
  for (double t = begin(); t < end(); t += spacing_ / 16) height = std::max(height, value(t));
  if (!(height > 0) || !std::isfinite(height)) throw std::invalid_argument("StripeProfile::fit: nothing rises above 0");
  for (Piece& p : pieces_) p = {p.c0 / height, p.c1 / height, p.c2 / height, p.c3 / height};
  begin_ -= centre_above(0);
  upper_centre_ = centre_above(centre_threshold);
}

double StripeProfile::centre_above(double threshold) const {
  const double step = spacing_ / 16;
  double mass = 0, moment = 0;
  for (double t = begin() + 0.5 * step; t < end(); t += step) {
    const double above = std::max(0.0, value(t) - threshold);
    mass += above;
    moment += above * t;
  }
  return moment / mass;
}

void StripeProfile::measure_width() {
  const double step = spacing_ / 64;
  double rise = begin(), fall = end() - 1e-9;
  while (value(rise) < 0.5) rise += step;
  while (value(fall) < 0.5) fall -= step;
  fwhm_ = fall - rise;
}

}  // namespace pagesweep
