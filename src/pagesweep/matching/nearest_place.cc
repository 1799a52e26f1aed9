// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/nearest_place.h"

#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

// Not worth their time to compile beside SSE4, AVX2 and AVX-512.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pagesweep/matching/nearest_place.cc"
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace pagesweep::HWY_NAMESPACE {
namespace {
namespace hn = hwy::HWY_NAMESPACE;

using Floats = hn::CappedTag<float, PlaceBatch::most>;
using Vector = hn::Vec<Floats>;
using Mask = hn::Mask<Floats>;
constexpr std::size_t crossings = PlaceBatch::crossings;

Vector set(double value) { return hn::Set(Floats(), static_cast<float>(value)); }
Vector zero() { return hn::Zero(Floats()); }
Vector square(Vector v) { return hn::Mul(v, v); }
Vector clamp_share(Vector t) { return hn::Min(hn::Max(t, zero()), set(1)); }

/// What rounding may do to a sum of products, as a share of g . g.
constexpr double rounding = 1e-6;

/// A place between the crossings 1 and 2.
struct Place {
  Vector share, distance_squared, gain;
};

Place select(Mask first, const Place& a, const Place& b) {
  return {hn::IfThenElse(first, a.share, b.share), hn::IfThenElse(first, a.distance_squared, b.distance_squared),
          hn::IfThenElse(first, a.gain, b.gain)};
}

struct Weights {
  Vector value[crossings], change[crossings];
};

Weights linear_at(Vector t) { return {{zero(), hn::Sub(set(1), t), t, zero()}, {zero(), set(-1), set(1), zero()}}; }

/// See cubic_weights().
Weights cubic_at(Vector t) {
  const auto parabola = [&](double c0, double c1, double c2) {
    return hn::MulAdd(t, hn::MulAdd(t, set(c2), set(c1)), set(c0));
  };
  const Vector tt = hn::Mul(t, t);
  return {{hn::Mul(t, parabola(-0.5, 1, -0.5)), hn::MulAdd(tt, hn::MulAdd(t, set(1.5), set(-2.5)), set(1)),
           hn::Mul(t, parabola(0.5, 2, -1.5)), hn::Mul(tt, hn::MulAdd(t, set(0.5), set(-0.5)))},
          {parabola(-0.5, 2, -1.5), parabola(0, -5, 4.5), parabola(0.5, 4, -4.5), parabola(0, -1, 1.5)}};
}

/// Some pixels of a batch.
class Pixels {
 public:
  Pixels(const PlaceBatch& batch, std::size_t first, bool affine)
      : batch_(batch), first_(first), affine_(affine), gg_(load(batch.gg)) {
    for (std::size_t i = 0; i < crossings; ++i) {
      gs_[i] = load(batch.gs[i]);
      noise_share_[i] = load(batch.noise_share[i]);
      for (std::size_t j = i; j < crossings; ++j) ss_[i][j] = ss_[j][i] = load(batch.ss[i][j]);
    }
  }

  Mask has(std::size_t crossing) const { return hn::Gt(load(batch_.usable[crossing]), zero()); }
  Vector load(const PlaceBatch::Each& values) const { return hn::Load(Floats(), &values[first_]); }
  void store(Vector v, PlaceBatch::Each& values) const { hn::Store(v, Floats(), &values[first_]); }

  /// Takes the noise's expected part off the crossings' squares, or adds it again.
  void add_noise(Vector energy) {
    for (std::size_t i = 0; i < crossings; ++i) ss_[i][i] = hn::MulAdd(energy, noise_share_[i], ss_[i][i]);
  }

  /// Variance of a sample of the other camera that explains the distance.
  Vector noise_variance(const Place& place, const Weights& weights) const {
    Vector shares = set(1);
    for (std::size_t k = 0; k < crossings; ++k)
      shares = hn::MulAdd(square(hn::Mul(place.gain, weights.value[k])), noise_share_[k], shares);
    return hn::Div(place.distance_squared, hn::Mul(shares, set(batch_.freedom)));
  }

  /// Where the line through S_1 and S_2 comes nearest to g.
  Place nearest_on_line() const {
    const Vector g0 = gs_[1], g1 = gs_[2], s0 = ss_[1][1], s1 = ss_[2][2], s01 = ss_[1][2];
    Vector t;
    if (affine_) {  // g's coefficients in the plane, times a determinant
      const Vector a = hn::MulSub(g0, s1, hn::Mul(g1, s01)), b = hn::MulSub(g1, s0, hn::Mul(g0, s01));
      const Vector nearer = hn::IfThenElseZero(hn::Gt(g1, g0), set(1)), sum = hn::Add(a, b);
      t = hn::IfThenElse(hn::Gt(sum, zero()), hn::Div(b, sum), nearer);
    } else {
      const Vector length_squared = hn::Add(hn::NegMulAdd(set(2), s01, s0), s1);
      const Vector along = hn::Add(hn::Sub(g1, g0), hn::Sub(s0, s01));
      t = hn::IfThenElseZero(hn::Gt(length_squared, zero()), hn::Div(along, length_squared));
    }
    t = clamp_share(t);
    const Vector r = hn::Sub(set(1), t), rt = hn::Mul(set(2), hn::Mul(r, t));
    const Vector ss = hn::MulAdd(square(r), s0, hn::MulAdd(square(t), s1, hn::Mul(rt, s01)));
    return make_place(t, hn::MulAdd(r, g0, hn::Mul(t, g1)), ss);
  }

  /// Goes on along the spline.
  Place polish(Vector share, Mask moving) const {
    constexpr int steps = 4;
    auto [here, step] = compare(share);
    for (int i = 0; i < steps && !hn::AllFalse(Floats(), moving); ++i) {
      const Vector bounded = hn::Min(hn::Max(step, set(-0.5)), set(0.5));
      const auto [there, next_step] = compare(clamp_share(hn::Add(here.share, bounded)));
      const Vector limit = hn::MulAdd(set(rounding), gg_, here.distance_squared);
      moving = hn::And(moving, hn::Le(there.distance_squared, limit));
      const Mask arrived = hn::Lt(hn::Abs(step), set(1e-4));
      here = select(moving, there, here);
      step = hn::IfThenElse(moving, next_step, step);
      moving = hn::AndNot(arrived, moving);
    }
    return here;
  }

  /// How much the sequences change along the curve at a place, and what follows for its standard deviation.
  void judge(const Place& place, const Weights& weights, Vector noise_variance, Vector doubt, PlaceBatch& out) const {
    Vector gd = zero(), dd = zero(), noise = zero();
    for (std::size_t k = 0; k < crossings; ++k) {
      Vector changed = zero();
      for (std::size_t j = 0; j < crossings; ++j) changed = hn::MulAdd(ss_[k][j], weights.change[j], changed);
      gd = hn::MulAdd(gs_[k], weights.change[k], gd);
      dd = hn::MulAdd(changed, weights.change[k], dd);
      noise = hn::MulAdd(square(weights.change[k]), noise_share_[k], noise);
    }
    const Vector gain_squared = square(place.gain);
    const Vector along_own = affine_ ? hn::Div(gd, gg_) : zero();
    const Vector rounded = hn::NegMulAdd(set(rounding), gg_, hn::NegMulAdd(along_own, gd, dd));
    const Vector change = hn::Mul(gain_squared, rounded);
    // Noise of the crossings looks like change; only what exceeds it, and its chi-squared scatter, is known to be
    // change.
    const Vector most_noise = set(batch_.samples * (1 + 3 * std::sqrt(2 / batch_.samples)));
    const Vector known = hn::NegMulAdd(hn::Mul(noise_variance, most_noise), hn::Mul(noise, gain_squared), change);
    const Vector variance = hn::Div(place.distance_squared, hn::Mul(set(batch_.freedom), known));
    const Vector sigma = hn::Sqrt(hn::MulAdd(doubt, doubt, variance));
    store(hn::Max(known, zero()), out.change_squared);
    store(hn::Mul(place.gain, along_own), out.change_along_own);
    store(hn::IfThenElse(hn::Gt(known, zero()), sigma, set(std::numeric_limits<float>::infinity())), out.sigma);
  }

  Vector distance_squared(const Weights& weights) const {
    Vector gs = zero(), ss = zero();
    for (std::size_t k = 0; k < crossings; ++k) {
      gs = hn::MulAdd(gs_[k], weights.value[k], gs);
      for (std::size_t j = 0; j < crossings; ++j)
        ss = hn::MulAdd(hn::Mul(weights.value[k], weights.value[j]), ss_[k][j], ss);
    }
    return hn::Max(zero(), make_place(zero(), gs, ss).distance_squared);
  }

 private:
  /// The distance of g and a sequence S with these scalar products g . S and S . S, scaled by the gain that suits it
  /// best.
  Place make_place(Vector share, Vector gs, Vector ss) const {
    if (!affine_) return {share, hn::Add(hn::NegMulAdd(set(2), gs, gg_), ss), set(1)};
    const Mask alike = hn::And(hn::Gt(gs, zero()), hn::Gt(ss, zero()));
    const Vector gain = hn::IfThenElse(alike, hn::Div(gs, ss), set(1));
    return {share, hn::IfThenElse(alike, hn::NegMulAdd(gs, gain, gg_), gg_), gain};
  }

  /// A place on the spline, and [crossings] how far it is from there to the least distance, by Gauss-Newton.
  std::pair<Place, Vector> compare(Vector share) const {
    const Weights weights = cubic_at(share);
    Vector gs = zero(), gd = zero(), ss = zero(), sd = zero(), dd = zero();
    for (std::size_t k = 0; k < crossings; ++k) {
      Vector carried = zero(), changed = zero();
      for (std::size_t j = 0; j < crossings; ++j) {
        carried = hn::MulAdd(ss_[k][j], weights.value[j], carried);
        changed = hn::MulAdd(ss_[k][j], weights.change[j], changed);
      }
      gs = hn::MulAdd(gs_[k], weights.value[k], gs);
      gd = hn::MulAdd(gs_[k], weights.change[k], gd);
      ss = hn::MulAdd(carried, weights.value[k], ss);
      sd = hn::MulAdd(carried, weights.change[k], sd);
      dd = hn::MulAdd(changed, weights.change[k], dd);
    }
    const Place place = make_place(share, gs, ss);
    if (!affine_) return {place, hn::IfThenElseZero(hn::Gt(dd, zero()), hn::Div(hn::Sub(gd, sd), dd))};
    const Vector across = hn::Sub(dd, hn::Div(square(sd), ss));
    const Mask known = hn::And(hn::And(hn::Gt(gs, zero()), hn::Gt(ss, zero())), hn::Gt(across, zero()));
    const Vector step = hn::Div(hn::NegMulAdd(place.gain, sd, gd), hn::Mul(place.gain, across));
    return {place, hn::IfThenElseZero(known, step)};
  }

  const PlaceBatch& batch_;
  std::size_t first_;
  bool affine_;
  Vector gg_, gs_[crossings], ss_[crossings][crossings], noise_share_[crossings];
};

void find_some(PlaceBatch& batch, std::size_t first, bool affine, bool wants_cubic) {
  Pixels pixels(batch, first, affine);
  const Place with_noise = pixels.nearest_on_line();
  const Vector variance = pixels.noise_variance(with_noise, linear_at(with_noise.share));
  Vector noise_energy = hn::Mul(variance, set(batch.samples));
  pixels.add_noise(hn::Neg(noise_energy));
  Place linear = pixels.nearest_on_line();
  // Noise never moves a place by more; then it was something else that is not alike.
  constexpr double farthest = 0.5;
  const Mask unlikely = hn::Ge(hn::Abs(hn::Sub(linear.share, with_noise.share)), set(farthest));
  linear = select(unlikely, with_noise, linear);
  pixels.add_noise(hn::IfThenElseZero(unlikely, noise_energy));
  noise_energy = hn::IfThenZeroElse(unlikely, noise_energy);
  const Mask has_two = hn::And(pixels.has(1), pixels.has(2));
  const Mask has_four = hn::And(has_two, hn::And(pixels.has(0), pixels.has(3)));
  const Place cubic = pixels.polish(linear.share, has_four);
  const Mask is_cubic = wants_cubic ? has_four : hn::MaskFromVec(zero());
  // The place is found without noise, but its distance is what it is.
  pixels.add_noise(noise_energy);
  Place place = select(is_cubic, cubic, linear);
  const Weights linear_weights = linear_at(place.share);
  Weights weights = cubic_at(place.share);
  for (std::size_t k = 0; k < crossings; ++k) {
    weights.value[k] = hn::IfThenElse(is_cubic, weights.value[k], linear_weights.value[k]);
    weights.change[k] = hn::IfThenElse(is_cubic, weights.change[k], linear_weights.change[k]);
  }
  place.distance_squared = pixels.distance_squared(weights);
  pixels.store(place.distance_squared, batch.distance_squared);
  const Vector noise_variance = pixels.noise_variance(place, weights);
  const Vector doubt = hn::IfThenElseZero(has_four, hn::Abs(hn::Sub(cubic.share, linear.share)));
  pixels.judge(place, weights, noise_variance, doubt, batch);
  pixels.store(noise_variance, batch.noise_variance);
  pixels.store(place.gain, batch.gain);
  pixels.store(hn::IfThenElse(has_two, place.share, set(std::numeric_limits<float>::quiet_NaN())), batch.share);
  pixels.store(hn::IfThenElseZero(is_cubic, set(1)), batch.is_cubic);
  pixels.store(doubt, batch.doubt);
}

void FindNearestPlaces(PlaceBatch& batch, Normalisation normalisation, Interpolation interpolation) {
  for (std::size_t first = 0; first < batch.count; first += hn::Lanes(Floats()))
    find_some(batch, first, normalisation == Normalisation::affine, interpolation == Interpolation::cubic);
}

}  // namespace
}  // namespace pagesweep::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pagesweep {

HWY_EXPORT(FindNearestPlaces);

void find_nearest_places(PlaceBatch& batch, Normalisation normalisation, Interpolation interpolation) {
  HWY_DYNAMIC_DISPATCH(FindNearestPlaces)(batch, normalisation, interpolation);
}

CrossingWeights linear_weights(double share) { return {{0, 1 - share, share, 0}, {0, -1, 1, 0}}; }

CrossingWeights cubic_weights(double t) {
  return {{0.5 * t * (-1 + t * (2 - t)), 1 + t * t * (-2.5 + 1.5 * t), 0.5 * t * (1 + t * (4 - 3 * t)),
           0.5 * t * t * (t - 1)},
          {0.5 * (-1 + t * (4 - 3 * t)), t * (-5 + 4.5 * t), 0.5 * (1 + t * (8 - 9 * t)), 0.5 * t * (3 * t - 2)}};
}

}  // namespace pagesweep
#endif  // HWY_ONCE
