// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/nearest_place.h"

#include <algorithm>
#include <cmath>

namespace pagesweep {
namespace {

constexpr int crossings = SequenceProducts::crossings;
/// An interpolated sequence S = sum of value_k S_(segment - 1 + k), and its change a crossing.
struct Interpolated {
  Eigen::Vector4d value, derivative;
};

Interpolated linear_at(double t) { return {{0, 1 - t, t, 0}, {0, -1, 1, 0}}; }

/// Catmull-Rom spline.
Interpolated cubic_at(double t) {
  return {{0.5 * t * (-1 + t * (2 - t)), 1 + t * t * (-2.5 + 1.5 * t), 0.5 * t * (1 + t * (4 - 3 * t)),
           0.5 * t * t * (t - 1)},
          {0.5 * (-1 + t * (4 - 3 * t)), t * (-5 + 4.5 * t), 0.5 * (1 + t * (8 - 9 * t)), 0.5 * t * (3 * t - 2)}};
}

/// How well g and an interpolated sequence S agree. \tparam affine  S is scaled by the gain that suits it best
struct Comparison {
  double distance_squared, gain;
  double step;  ///< [crossings] to the least distance, by Gauss-Newton
};

Comparison compare(const SequenceProducts& p, int segment, const Interpolated& s, bool affine) {
  const Eigen::Vector4d g = p.gs.segment<4>(segment - 1);
  const Eigen::Matrix4d products = p.ss.block<4, 4>(segment - 1, segment - 1);
  const Eigen::Vector4d carried = products * s.value;
  const double gs = s.value.dot(g), gd = s.derivative.dot(g), ss = s.value.dot(carried);
  const double sd = s.derivative.dot(carried), dd = s.derivative.dot(products * s.derivative);
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

bool has_four(const SequenceProducts& p, int segment) {
  return is_usable(p, segment - 1) && is_usable(p, segment) && is_usable(p, segment + 1) && is_usable(p, segment + 2);
}

/// Moves on along the spline, from one segment to the next if need be.
CurvePlace polish(const SequenceProducts& p, int segment, double share, bool affine) {
  constexpr int steps = 4;
  Interpolated interpolated = cubic_at(share);
  Comparison here = compare(p, segment, interpolated, affine);
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
    const Interpolated moved = cubic_at(next_share);
    const Comparison there = compare(p, next, moved, affine);
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

CurvePlace nearest_on_polyline(const SequenceProducts& p, Normalisation normalisation) {
  const bool affine = normalisation == Normalisation::affine;
  CurvePlace nearest;
  for (int i = 1; i + 2 < crossings; ++i) {
    if (!is_usable(p, i) || !is_usable(p, i + 1)) continue;
    const double share = std::clamp(best_share(p, i, affine), 0.0, 1.0);
    const Interpolated interpolated = linear_at(share);
    const Comparison here = compare(p, i, interpolated, affine);
    if (here.distance_squared < nearest.distance_squared) nearest = make_place(p, i, share, interpolated, here);
  }
  return nearest;
}

CurvePlace nearest_place(const SequenceProducts& products, const CurvePlace& start, Normalisation normalisation,
                         Interpolation interpolation) {
  if (start.segment < 0 || !has_four(products, start.segment)) return start;
  CurvePlace linear = start;
  CurvePlace cubic = polish(products, start.segment, start.share, normalisation == Normalisation::affine);
  linear.doubt = cubic.doubt = std::abs(cubic.segment + cubic.share - linear.segment - linear.share);
  return interpolation == Interpolation::cubic ? cubic : linear;
}

double distance_squared(const SequenceProducts& products, const CurvePlace& place, Normalisation normalisation) {
  const Interpolated there{place.value, place.derivative};
  const double distance =
      compare(products, place.segment, there, normalisation == Normalisation::affine).distance_squared;
  return std::max(0.0, distance);
}

}  // namespace pagesweep
