// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/nearest_place.h"

#include <algorithm>
#include <cmath>

namespace pagesweep {
namespace {

constexpr int crossings = SequenceProducts::crossings;
using Weights = Eigen::Matrix<double, crossings, 1>;

/// An interpolated sequence S = sum of value_i S_i, and its change a crossing.
struct Interpolated {
  Weights value = Weights::Zero(), derivative = Weights::Zero();
};

Interpolated linear_at(int segment, double t) {
  Interpolated s;
  s.value.segment<2>(segment) << 1 - t, t;
  s.derivative.segment<2>(segment) << -1, 1;
  return s;
}

/// Catmull-Rom spline.
Interpolated cubic_at(int segment, double t) {
  Interpolated s;
  s.value.segment<4>(segment - 1) << 0.5 * t * (-1 + t * (2 - t)), 1 + t * t * (-2.5 + 1.5 * t),
      0.5 * t * (1 + t * (4 - 3 * t)), 0.5 * t * t * (t - 1);
  s.derivative.segment<4>(segment - 1) << 0.5 * (-1 + t * (4 - 3 * t)), t * (-5 + 4.5 * t), 0.5 * (1 + t * (8 - 9 * t)),
      0.5 * t * (3 * t - 2);
  return s;
}

/// How well g and an interpolated sequence S agree. \tparam affine  S is scaled by the gain that suits it best
struct Comparison {
  double distance_squared, gain;
  double step;  ///< [crossings] to the least distance, by Gauss-Newton
};

Comparison compare(const SequenceProducts& p, const Interpolated& s, bool affine) {
  const double gs = s.value.dot(p.gs), gd = s.derivative.dot(p.gs);
  const Weights carried = p.ss * s.value;
  const double ss = s.value.dot(carried), sd = s.derivative.dot(carried), dd = s.derivative.dot(p.ss * s.derivative);
  if (!affine) return {p.gg - 2 * gs + ss, 1, dd > 0 ? (gd - sd) / dd : 0};
  if (!(gs > 0 && ss > 0)) return {p.gg, 1, 0};
  const double gain = gs / ss, across = dd - sd * sd / ss;
  return {p.gg - gs * gain, gain, across > 0 ? (gd - gain * sd) / (gain * across) : 0};
}

/// Where on the line through a segment the distance is least.
double best_share(const SequenceProducts& p, int i, bool affine) {
  const double s0 = p.ss(i, i), s1 = p.ss(i + 1, i + 1), s01 = p.ss(i, i + 1), g0 = p.gs[i], g1 = p.gs[i + 1];
  if (!affine) {
    const double length_squared = s0 - 2 * s01 + s1;
    return length_squared > 0 ? (g1 - g0 + s0 - s01) / length_squared : 0;
  }
  const double a = g0 * s1 - g1 * s01, b = g1 * s0 - g0 * s01;  // g's coefficients in the plane, times a determinant
  return a + b > 0 ? b / (a + b) : (g1 > g0 ? 1 : 0);
}

bool is_usable(const SequenceProducts& p, int i) {
  return i >= 0 && i < crossings && p.usable[static_cast<std::size_t>(i)];
}

CurvePlace make_place(const SequenceProducts& p, int segment, double share, const Interpolated& s,
                      const Comparison& comparison) {
  const bool at_end = (share <= 0 && !is_usable(p, segment - 1)) || (share >= 1 && !is_usable(p, segment + 2));
  return {segment,         share, at_end,  std::max(0.0, comparison.distance_squared),
          comparison.gain, 0,     s.value, s.derivative};
}

CurvePlace nearest_on_polyline(const SequenceProducts& p, bool affine) {
  CurvePlace nearest;
  for (int i = 1; i + 2 < crossings; ++i) {
    if (!is_usable(p, i) || !is_usable(p, i + 1)) continue;
    const double share = std::clamp(best_share(p, i, affine), 0.0, 1.0);
    const Interpolated interpolated = linear_at(i, share);
    const Comparison here = compare(p, interpolated, affine);
    if (here.distance_squared < nearest.distance_squared) nearest = make_place(p, i, share, interpolated, here);
  }
  return nearest;
}

bool has_four(const SequenceProducts& p, int segment) {
  return is_usable(p, segment - 1) && is_usable(p, segment) && is_usable(p, segment + 1) && is_usable(p, segment + 2);
}

/// Moves on along the spline, from one segment to the next if need be.
CurvePlace polish(const SequenceProducts& p, int segment, double share, bool affine) {
  constexpr int steps = 4;
  Interpolated interpolated = cubic_at(segment, share);
  Comparison here = compare(p, interpolated, affine);
  for (int i = 0; i < steps; ++i) {
    int next = segment;
    double next_share = share + std::clamp(here.step, -0.5, 0.5);
    if (next_share < 0 && has_four(p, next - 1)) {
      --next;
      ++next_share;
    } else if (next_share > 1 && has_four(p, next + 1)) {
      ++next;
      --next_share;
    }
    next_share = std::clamp(next_share, 0.0, 1.0);
    const Interpolated moved = cubic_at(next, next_share);
    const Comparison there = compare(p, moved, affine);
    if (!(there.distance_squared <= here.distance_squared)) break;
    const bool arrived = std::abs(here.step) < 1e-4;
    segment = next;
    share = next_share;
    interpolated = moved;
    here = there;
    if (arrived) break;
  }
  return make_place(p, segment, share, interpolated, here);
}

}  // namespace

CurvePlace nearest_place(const SequenceProducts& products, Normalisation normalisation, Interpolation interpolation) {
  const bool affine = normalisation == Normalisation::affine;
  CurvePlace linear = nearest_on_polyline(products, affine);
  if (linear.segment < 0 || !has_four(products, linear.segment)) return linear;
  CurvePlace cubic = polish(products, linear.segment, linear.share, affine);
  linear.doubt = cubic.doubt = std::abs(cubic.segment + cubic.share - linear.segment - linear.share);
  return interpolation == Interpolation::cubic ? cubic : linear;
}

}  // namespace pagesweep
