// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/follow_curves.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>

// Not worth their time to compile beside SSE4, AVX2 and AVX-512.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pagesweep/matching/follow_curves.cc"
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace pagesweep::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Floats = hn::CappedTag<float, most_curves>;
using Integers = hn::RebindToSigned<Floats>;
using Vector = hn::Vec<Floats>;
using Mask = hn::Mask<Floats>;

Vector set(float value) { return hn::Set(Floats(), value); }
Vector no_number() { return set(std::numeric_limits<float>::quiet_NaN()); }

/// Some of the batch's pixels.
class Curves {
 public:
  Curves(const CurveBatch& batch, std::size_t first) : batch_(batch), first_(first) {
    for (std::size_t axis = 0; axis < 3; ++axis) direction_[axis] = load(batch.direction[axis]);
    time_ = load(batch.time);
  }
  /// Places on one curve.
  Curves(const CurveBatch& batch, const std::array<float, 3>& direction, float time) : batch_(batch), first_(0) {
    for (std::size_t axis = 0; axis < 3; ++axis) direction_[axis] = set(direction[axis]);
    time_ = set(time);
  }

  Vector load(const CurveBatch::Each<float>& values) const { return hn::LoadU(Floats(), &values[first_]); }
  void store(Vector v, CurveBatch::Each<float>& values) const { hn::StoreU(v, Floats(), &values[first_]); }

  /// A place on each curve, and the cell of pixels around it.
  struct Place {
    Vector u, v;  ///< [px]
    hn::Vec<Integers> cell;
    Vector right, down;  ///< [px] from the cell's first pixel
    Mask imaged;         ///< by the lens, be it inside the picture or not
    Mask seen;
  };

  HWY_INLINE Place at(Vector w) const {
    const LensNumbers& lens = batch_.lens;
    const Vector z = along(2, w), scale = hn::Div(set(1), z);
    const Vector x = hn::Mul(along(0, w), scale), y = hn::Mul(along(1, w), scale);
    const Vector xx = hn::Mul(x, x), yy = hn::Mul(y, y), xy2 = hn::Mul(set(2), hn::Mul(x, y)), rr = hn::Add(xx, yy);
    const Vector radial =
        hn::MulAdd(rr, hn::MulAdd(rr, hn::MulAdd(rr, set(lens.k3), set(lens.k2)), set(lens.k1)), set(1));
    const Vector tangent_x = hn::MulAdd(set(lens.p1), xy2, hn::Mul(set(lens.p2), hn::MulAdd(set(2), xx, rr)));
    const Vector tangent_y = hn::MulAdd(set(lens.p2), xy2, hn::Mul(set(lens.p1), hn::MulAdd(set(2), yy, rr)));
    Place place;
    place.u = hn::MulAdd(set(lens.fx), hn::MulAdd(x, radial, tangent_x), set(lens.cx));
    place.v = hn::MulAdd(set(lens.fy), hn::MulAdd(y, radial, tangent_y), set(lens.cy));
    const auto width = static_cast<float>(batch_.times.width), height = static_cast<float>(batch_.times.height);
    const auto inside = [](Vector p, float end) { return hn::And(hn::Ge(p, set(-0.5f)), hn::Le(p, set(end - 0.5f))); };
    place.imaged = hn::And(hn::Gt(z, set(0)), hn::Le(rr, set(lens.max_radius_squared)));
    place.seen = hn::And(hn::And(inside(place.u, width), inside(place.v, height)), place.imaged);
    // A place in the outer half pixel takes the outermost cell, and no less than its border.
    const Vector column = hn::Min(hn::Max(hn::IfThenElseZero(place.seen, place.u), set(0)), set(width - 1));
    const Vector row = hn::Min(hn::Max(hn::IfThenElseZero(place.seen, place.v), set(0)), set(height - 1));
    const Vector left = hn::Min(hn::Floor(column), set(width - 2)), top = hn::Min(hn::Floor(row), set(height - 2));
    place.right = hn::Sub(column, left);
    place.down = hn::Sub(row, top);
    const Integers integers;
    place.cell = hn::Add(hn::Mul(hn::ConvertTo(integers, top), hn::Set(integers, batch_.times.width)),
                         hn::ConvertTo(integers, left));
    return place;
  }

  /// How far the other camera's time is ahead of the pixel's; NaN where there is none.
  HWY_INLINE Vector ahead(const Place& place) const {
    const Vector time = hn::Add(between(batch_.times.time, place), gather(batch_.times.between, place, 0));
    return hn::IfThenElse(place.seen, hn::Sub(time, time_), no_number());
  }
  HWY_INLINE Vector ahead(Vector w) const { return ahead(at(w)); }

  Vector amplitude(const Place& place) const { return between(batch_.times.amplitude, place); }

  HWY_INLINE Vector variance(const Place& place) const {
    const Vector left = hn::Sub(set(1), place.right), up = hn::Sub(set(1), place.down);
    const int width = batch_.times.width;
    const auto part = [&](int offset, Vector weight) {
      const Vector sigma = hn::Mul(weight, gather(batch_.times.sigma, place, offset));
      return hn::Mul(sigma, sigma);
    };
    return hn::Add(hn::Add(part(0, hn::Mul(left, up)), part(1, hn::Mul(place.right, up))),
                   hn::Add(part(width, hn::Mul(left, place.down)), part(width + 1, hn::Mul(place.right, place.down))));
  }

  /// Inverse depth a pixel of the other picture, the lens taken as ideal.
  HWY_INLINE Vector step(Vector w) const {
    const Vector x = along(0, w), y = along(1, w), z = along(2, w);
    const auto& [bx, by, bz] = batch_.origin;
    const Vector du = hn::MulSub(set(bx), z, hn::Mul(x, set(bz))), dv = hn::MulSub(set(by), z, hn::Mul(y, set(bz)));
    const Vector speed = hn::Mul(set(batch_.lens.fx), hn::Sqrt(hn::MulAdd(du, du, hn::Mul(dv, dv))));
    return hn::Div(hn::Mul(z, z), speed);
  }

  Mask is_allowed(Vector w) const { return hn::And(hn::Ge(w, set(batch_.far)), hn::Le(w, set(batch_.near))); }

 private:
  HWY_INLINE Vector along(std::size_t axis, Vector w) const {
    return hn::MulAdd(w, set(batch_.origin[axis]), direction_[axis]);
  }
  static HWY_INLINE Vector gather(const float* values, const Place& place, int offset) {
    return hn::GatherIndex(Floats(), values + offset, place.cell);
  }
  HWY_INLINE Vector between(const float* values, const Place& place) const {
    const int width = batch_.times.width;
    const Vector a = gather(values, place, 0), b = gather(values, place, 1);
    const Vector c = gather(values, place, width), d = gather(values, place, width + 1);
    const Vector upper = hn::MulAdd(place.right, hn::Sub(b, a), a), lower = hn::MulAdd(place.right, hn::Sub(d, c), c);
    return hn::MulAdd(place.down, hn::Sub(lower, upper), upper);
  }

  const CurveBatch& batch_;
  const std::size_t first_;
  Vector direction_[3], time_;
};

/// The depth where the times are equal; NaN where secants do not lead there.
HWY_INLINE Vector find_root(const Curves& curves, Vector expected) {
  const Floats d;
  const Vector step = curves.step(expected), precise = hn::Mul(set(1e-3f), step);
  Vector before = expected, at_before = curves.ahead(before);
  Vector here = hn::Add(expected, step), at_here = curves.ahead(here);
  const auto secant = [&] { return hn::Div(hn::Mul(at_here, hn::Sub(before, here)), hn::Sub(at_here, at_before)); };
  // The neighbourhood predicts the place, give or take half as much and half a pixel. What leads elsewhere is left out.
  const Vector middle = hn::Add(here, secant());
  const Vector reach = hn::Mul(set(0.5f), hn::Add(step, hn::Abs(hn::Sub(middle, expected))));
  const Vector most = hn::Mul(set(6), step);
  Vector root = no_number();
  for (int tries = 0; tries < 6; ++tries) {
    const Vector move = secant(), next = hn::Add(here, move);
    const auto near =
        hn::And(hn::Le(hn::Abs(hn::Sub(next, middle)), reach), hn::Le(hn::Abs(hn::Sub(next, expected)), most));
    const auto arrived = hn::And(near, hn::Lt(hn::Abs(move), precise));
    root = hn::IfThenElse(hn::And(arrived, hn::IsNaN(root)), next, root);
    before = here;
    at_before = at_here;
    here = hn::IfThenElse(near, next, no_number());
    if (hn::AllTrue(d, hn::Or(hn::Eq(root, root), hn::IsNaN(here)))) break;
    at_here = curves.ahead(here);
  }
  return root;
}

void FollowCurves(CurveBatch& batch) {
  const Floats d;
  for (std::size_t first = 0; first < most_curves; first += hn::Lanes(d)) {
    const Curves curves(batch, first);
    const Vector root = find_root(curves, curves.load(batch.expected));
    const auto place = curves.at(root);
    const Vector step = curves.step(root);
    const Vector at_before = curves.ahead(hn::Sub(root, step)), at_behind = curves.ahead(hn::Add(root, step));
    // Over two pixels: over less, noise would be taken for slope. NaN beside a gap or the border.
    const Vector slope = hn::Mul(set(0.5f), hn::Sub(at_behind, at_before));
    const Vector contrast =
        hn::Div(curves.amplitude(place), hn::Mul(set(batch.brightness), curves.load(batch.amplitude)));
    const auto is_alike =
        hn::And(hn::Lt(contrast, set(batch.most_contrast)), hn::Gt(contrast, set(1 / batch.most_contrast)));
    const auto is_good = hn::And(hn::And(curves.is_allowed(root), is_alike), hn::Eq(slope, slope));
    curves.store(hn::IfThenElse(is_good, root, no_number()), batch.inverse_depth);
    curves.store(place.u, batch.u);
    curves.store(place.v, batch.v);
    curves.store(slope, batch.slope);
    curves.store(curves.variance(place), batch.variance);
  }
}

/// Places on one curve, a stretch of them at a time.
class CurveSearch {
 public:
  CurveSearch(const CurveBatch& batch, const std::array<float, 3>& direction, float time, float first, float step,
              std::size_t count)
      : curves_(batch, direction, time), times_(batch.times), time_(time), first_(first), step_(step), count_(count) {}

  /// Looks closely where the time may be that is looked for, and else nowhere.
  bool operator()(std::vector<std::size_t>& changes) const {
    const std::size_t stretches = (count_ + stretch - 1) / stretch, at_once = hn::Lanes(Floats()) - 1;
    bool seen = false;
    for (std::size_t i = 0; i < stretches; i += at_once) {
      const Promise promise = look_over(i);
      seen = seen || promise.seen;
      for (std::size_t k = 0; k < at_once && i + k < stretches; ++k)
        if (promise.stretches >> k & 1u) seen = compare((i + k) * stretch, changes) || seen;
    }
    return seen || sees_any();
  }

 private:
  static constexpr std::size_t stretch = most_curves - 1;  ///< steps, so that their places are a vector at the most
  /// [px] Between the middles of two stretches, at most; a lens makes some steps a little longer than others. So no
  /// place is farther than a block from its stretch's middle, be the curve a little bent.
  static constexpr float farthest = 17;

  Curves::Place place_at(Vector k) const {
    return curves_.at(hn::MulAdd(hn::Min(k, set(static_cast<float>(count_))), set(step_), set(first_)));
  }

  bool sees_any() const {
    bool seen = false;
    for (std::size_t k = 0; k <= count_ && !seen; k += hn::Lanes(Floats()))
      seen = !hn::AllFalse(Floats(), place_at(hn::Iota(Floats(), static_cast<float>(k))).seen);
    return seen;
  }

  /// One bit a stretch, and whether any of their middles is seen.
  struct Promise {
    unsigned stretches;
    bool seen;
  };
  /// Which of the stretches from `first` on may have the time; of the last lane only the middle is looked at.
  Promise look_over(std::size_t first) const {
    const Floats d;
    constexpr auto length = static_cast<float>(stretch);
    const Vector index = hn::Add(hn::Iota(d, 0), set(static_cast<float>(first)));
    const auto place = place_at(hn::MulAdd(index, set(length), set(0.5f * length)));
    HWY_ALIGN float u[most_curves + 1], v[most_curves + 1];
    hn::StoreU(place.u, d, u);
    hn::StoreU(place.v, d, v);
    u[hn::Lanes(d)] = v[hn::Lanes(d)] = 0;
    const auto near = [&](const float* p, Vector here) {
      return hn::Le(hn::Abs(hn::Sub(hn::LoadU(d, p + 1), here)), set(farthest));
    };
    const Mask even = hn::And(hn::And(near(u, place.u), near(v, place.v)), place.imaged);
    const Mask hopeful = hn::Or(may_have_time(place), hn::Not(even));
    std::uint8_t bits[8] = {};
    hn::StoreMaskBits(d, hopeful, bits);
    return {static_cast<unsigned>(bits[0] | bits[1] << 8), !hn::AllFalse(d, place.seen)};
  }

  /// \return where the blocks around a place have times before and after
  Mask may_have_time(const Curves::Place& place) const {
    const Integers d;
    constexpr float share = 1.0f / time_block_px, rounding = 1e-3f;  // [frames]
    const int rows = (times_.height + time_block_px - 1) / time_block_px;
    const auto block = [&](Vector p, int blocks) {
      const Vector inside = hn::Min(hn::Max(hn::Mul(p, set(share)), set(0)), set(static_cast<float>(blocks - 1)));
      return hn::ConvertTo(d, hn::IfThenElseZero(place.imaged, inside));
    };
    const auto index = hn::Add(hn::Mul(block(place.v, rows), hn::Set(d, times_.blocks)), block(place.u, times_.blocks));
    return hn::And(hn::Le(hn::GatherIndex(Floats(), times_.earliest, index), set(time_ + rounding)),
                   hn::Ge(hn::GatherIndex(Floats(), times_.latest, index), set(time_ - rounding)));
  }

  /// \return whether any of the places of a stretch is seen
  bool compare(std::size_t first, std::vector<std::size_t>& changes) const {
    const Floats d;
    bool seen = false;
    HWY_ALIGN float ahead[most_curves];
    for (std::size_t k = 0; k < most_curves; k += hn::Lanes(d)) {
      const auto place = place_at(hn::Iota(d, static_cast<float>(first + k)));
      seen = seen || !hn::AllFalse(d, place.seen);
      hn::StoreU(curves_.ahead(place), d, ahead + k);
    }
    const std::size_t steps = std::min(stretch, count_ - first);
    for (std::size_t k = 0; k < steps; ++k)
      if (ahead[k] * ahead[k + 1] <= 0) changes.push_back(first + k);
    return seen;
  }

  Curves curves_;
  const TimeArrays& times_;
  float time_, first_, step_;
  std::size_t count_;
};

bool SearchCurve(const CurveBatch& batch, const std::array<float, 3>& direction, float time, float first, float step,
                 std::size_t count, std::vector<std::size_t>& changes) {
  changes.clear();
  return CurveSearch(batch, direction, time, first, step, count)(changes);
}

}  // namespace pagesweep::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pagesweep {

HWY_EXPORT(FollowCurves);
HWY_EXPORT(SearchCurve);

void follow_curves(CurveBatch& batch) { HWY_DYNAMIC_DISPATCH(FollowCurves)(batch); }

bool search_curve(const CurveBatch& batch, const std::array<float, 3>& direction, float time, float first, float step,
                  std::size_t count, std::vector<std::size_t>& changes) {
  return HWY_DYNAMIC_DISPATCH(SearchCurve)(batch, direction, time, first, step, count, changes);
}

}  // namespace pagesweep
#endif
