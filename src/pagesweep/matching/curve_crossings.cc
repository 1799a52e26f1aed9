// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/curve_crossings_internal.h"

// Not worth their time to compile beside SSE4, AVX2 and AVX-512.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pagesweep/matching/curve_crossings.cc"
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace pagesweep::HWY_NAMESPACE {
namespace {
namespace hn = hwy::HWY_NAMESPACE;

using Doubles = hn::CappedTag<double, CrossingBatch::most>;
using HalfFloats = hn::Rebind<float, Doubles>;
using Integers = hn::Rebind<std::int32_t, Doubles>;
using Vector = hn::Vec<Doubles>;

Vector set(double value) { return hn::Set(Doubles(), value); }
Vector twice(Vector v) { return hn::Add(v, v); }

struct Tangents {
  Vector u, v, du, dv;  ///< [px], and a unit of inverse depth
  hn::Mask<Doubles> known;
};

/// See View::locate().
Tangents locate(const CurveFrame& frame, int width, int height, const Vector* a, Vector w) {
  const LensNumbers& lens = frame.lens;
  const auto at = [&](std::size_t i) { return hn::MulAdd(w, set(frame.origin[i]), a[i]); };
  const Vector z = at(2), scale = hn::Div(set(1), z), x = hn::Mul(at(0), scale), y = hn::Mul(at(1), scale);
  const Vector dx = hn::Mul(scale, hn::NegMulAdd(x, set(frame.origin[2]), set(frame.origin[0])));
  const Vector dy = hn::Mul(scale, hn::NegMulAdd(y, set(frame.origin[2]), set(frame.origin[1])));
  const Vector xx = hn::Mul(x, x), yy = hn::Mul(y, y), xy = hn::Mul(x, y), rr = hn::Add(xx, yy);
  const Vector half_drr = hn::MulAdd(x, dx, hn::Mul(y, dy)), dxy = hn::MulAdd(x, dy, hn::Mul(y, dx));
  const auto polynomial = [&](double c0, double c1, double c2) {
    return hn::MulAdd(rr, hn::MulAdd(rr, set(c2), set(c1)), set(c0));
  };
  const Vector radial = hn::MulAdd(rr, polynomial(lens.k1, lens.k2, lens.k3), set(1));
  const Vector dradial = hn::Mul(twice(half_drr), polynomial(lens.k1, 2 * lens.k2, 3 * lens.k3));
  const Vector p1 = set(lens.p1), p2 = set(lens.p2);
  const Vector tangent_x = hn::MulAdd(p1, twice(xy), hn::Mul(p2, hn::Add(rr, twice(xx))));
  const Vector tangent_y = hn::MulAdd(p2, twice(xy), hn::Mul(p1, hn::Add(rr, twice(yy))));
  const Vector u = hn::MulAdd(set(lens.fx), hn::MulAdd(x, radial, tangent_x), set(lens.cx));
  const Vector v = hn::MulAdd(set(lens.fy), hn::MulAdd(y, radial, tangent_y), set(lens.cy));
  const Vector dtangent_x = hn::MulAdd(p1, dxy, hn::Mul(p2, hn::Add(half_drr, twice(hn::Mul(x, dx)))));
  const Vector dtangent_y = hn::MulAdd(p2, dxy, hn::Mul(p1, hn::Add(half_drr, twice(hn::Mul(y, dy)))));
  const Vector du = hn::MulAdd(dx, radial, hn::MulAdd(x, dradial, twice(dtangent_x)));
  const Vector dv = hn::MulAdd(dy, radial, hn::MulAdd(y, dradial, twice(dtangent_y)));
  const auto within = [](Vector p, int size) { return hn::And(hn::Ge(p, set(-0.5)), hn::Le(p, set(size - 0.5))); };
  const auto before = hn::And(hn::Gt(z, hn::Zero(Doubles())), hn::Le(rr, set(lens.max_radius_squared)));
  return {u, v, hn::Mul(set(lens.fx), du), hn::Mul(set(lens.fy), dv),
          hn::And(before, hn::And(within(u, width), within(v, height)))};
}

void cross_some(const CurveFrame& frame, int width, int height, CrossingBatch& batch, std::size_t k) {
  const auto load = [&](const CrossingBatch::Each<double>& values) { return hn::Load(Doubles(), &values[k]); };
  const auto store = [&](Vector v, CrossingBatch::Each<double>& values) { hn::Store(v, Doubles(), &values[k]); };
  const Vector a[] = {load(batch.direction[0]), load(batch.direction[1]), load(batch.direction[2])};
  const Vector w = load(batch.inverse_depth);
  const Tangents here = locate(frame, width, height, a, w);
  const auto along_rows = hn::Ge(hn::Abs(here.du), hn::Abs(here.dv));
  const auto main = [&](Vector in_x, Vector in_y) { return hn::IfThenElse(along_rows, in_x, in_y); };
  const Vector change = main(here.du, here.dv), step = hn::Div(set(1), change);
  const Vector slope = hn::Mul(main(here.dv, here.du), step), along = main(here.u, here.v);
  const auto known = hn::And(here.known, hn::Ne(change, hn::Zero(Doubles())));
  const Vector first = hn::IfThenElseZero(known, hn::Sub(hn::Floor(along), set(1)));
  const Vector back = hn::Sub(first, along);
  store(hn::IfThenElseZero(known, set(1)), batch.known);
  store(hn::IfThenElseZero(along_rows, set(1)), batch.along_rows);
  store(first, batch.first);
  store(hn::MulAdd(back, slope, main(here.v, here.u)), batch.at_first);
  store(slope, batch.slope);
  store(hn::MulAdd(back, step, w), batch.depth_at_first);
  store(step, batch.step);
}

void CrossGrid(const CurveFrame& frame, int width, int height, CrossingBatch& batch) {
  for (std::size_t k = 0; k < CrossingBatch::most; k += hn::Lanes(Doubles()))
    cross_some(frame, width, height, batch, k);
}

void SpreadCrossings(int width, int height, CrossingBatch& batch) {
  constexpr double one_share = 32768;  // see Crossings
  for (std::size_t k = 0; k < CrossingBatch::most; k += hn::Lanes(Doubles())) {
    const auto along_rows = hn::Gt(hn::Load(Doubles(), &batch.along_rows[k]), hn::Zero(Doubles()));
    const Vector last = hn::IfThenElse(along_rows, set(height - 1), set(width - 1));
    const Vector slope = hn::Load(Doubles(), &batch.slope[k]);
    Vector position = hn::Load(Doubles(), &batch.at_first[k]);
    hn::Vec<Integers> lows[CrossingBatch::crossings], shares[CrossingBatch::crossings];
    for (std::size_t i = 0; i < CrossingBatch::crossings; ++i, position = hn::Add(position, slope)) {
      const Vector across = hn::Min(hn::Max(position, hn::Zero(Doubles())), last), low = hn::Floor(across);
      const Vector share = hn::Sub(across, low), rest = hn::Sub(set(1), share);
      const Vector rounded = hn::Min(hn::MulAdd(share, set(one_share), set(0.5)), set(one_share - 1));
      lows[i] = hn::DemoteTo(Integers(), low);
      shares[i] = hn::DemoteTo(Integers(), rounded);
      shares[i] = hn::Or(shares[i], hn::ShiftLeft<16>(shares[i]));
      const Vector noise_share = hn::MulAdd(share, share, hn::Mul(rest, rest));
      hn::Store(hn::DemoteTo(HalfFloats(), noise_share), HalfFloats(), &batch.noise_share[i][k]);
    }
    const std::size_t at = k * CrossingBatch::crossings;
    hn::StoreInterleaved4(lows[0], lows[1], lows[2], lows[3], Integers(), &batch.low[at]);
    hn::StoreInterleaved4(shares[0], shares[1], shares[2], shares[3], Integers(), &batch.share[at]);
  }
}

}  // namespace
}  // namespace pagesweep::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pagesweep {

HWY_EXPORT(CrossGrid);
HWY_EXPORT(SpreadCrossings);

void cross_grid(const CurveFrame& frame, int width, int height, CrossingBatch& batch) {
  HWY_DYNAMIC_DISPATCH(CrossGrid)(frame, width, height, batch);
}

void spread_crossings(int width, int height, CrossingBatch& batch) {
  HWY_DYNAMIC_DISPATCH(SpreadCrossings)(width, height, batch);
}

}  // namespace pagesweep
#endif  // HWY_ONCE
