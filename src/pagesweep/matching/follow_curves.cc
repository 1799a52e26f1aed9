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

#include "pagesweep/matching/picture_lookup_internal.h"

HWY_BEFORE_NAMESPACE();
namespace pagesweep::HWY_NAMESPACE {
/// The other camera's picture, asked at a vector of places.
class Picture {
 public:
  explicit Picture(const TimeArrays& times) : times_(times) {}

  HWY_INLINE Place at(Vector u, Vector v) const { return place_at(u, v, times_.width, times_.height); }

  /// Pixels is Scattered or SideBySide. NaN where pixels are missing; but where they are not linked, a value between.
  template <class Pixels>
  HWY_INLINE Vector time(const Place& place, const Pixels& pixels) const {
    return hn::IfThenElse(place.inside, between(pixels.corners(times_.time), place), no_number());
  }
  /// NaN there as well.
  template <class Pixels>
  HWY_INLINE Vector linked_time(const Place& place, const Pixels& pixels) const {
    return hn::Add(time(place, pixels), pixels.pixel(times_.between));
  }
  const TimeArrays& times() const { return times_; }

 private:
  const TimeArrays& times_;
};

/// From the four pixels' sigma.
HWY_INLINE Vector variance(const Corners& sigma, const Place& place) {
  const Vector left = hn::Sub(set(1), place.right), up = hn::Sub(set(1), place.down);
  const auto part = [&](Vector own, Vector weight_x, Vector weight_y) {
    const Vector weighted = hn::Mul(own, hn::Mul(weight_x, weight_y));
    return hn::Mul(weighted, weighted);
  };
  return hn::Add(hn::Add(part(sigma.a, left, up), part(sigma.b, place.right, up)),
                 hn::Add(part(sigma.c, left, place.down), part(sigma.d, place.right, place.down)));
}

struct Vector3 {
  Vector x, y, z;
};

/// Where the lens images directions of the camera's frame.
struct Imaged {
  Vector u, v;  ///< [px]
  Mask valid;   ///< as far as the lens is known
};

class Lens {
 public:
  explicit Lens(const LensNumbers& lens) : lens_(lens) {}

  HWY_INLINE Imaged image(const Vector3& p) const {
    const Vector scale = hn::Div(set(1), p.z), x = hn::Mul(p.x, scale), y = hn::Mul(p.y, scale);
    const Vector xx = hn::Mul(x, x), yy = hn::Mul(y, y), xy2 = hn::Mul(set(2), hn::Mul(x, y)), rr = hn::Add(xx, yy);
    const Vector tangent_x = hn::MulAdd(set(lens_.p1), xy2, hn::Mul(set(lens_.p2), hn::MulAdd(set(2), xx, rr)));
    const Vector tangent_y = hn::MulAdd(set(lens_.p2), xy2, hn::Mul(set(lens_.p1), hn::MulAdd(set(2), yy, rr)));
    const Vector radial = radial_at(rr);
    return {hn::MulAdd(set(lens_.fx), hn::MulAdd(x, radial, tangent_x), set(lens_.cx)),
            hn::MulAdd(set(lens_.fy), hn::MulAdd(y, radial, tangent_y), set(lens_.cy)),
            hn::And(hn::Gt(p.z, set(0)), hn::Le(rr, set(lens_.max_radius_squared)))};
  }

  /// How the picture of p moves when p moves by a unit of `change`.
  HWY_INLINE void move(const Vector3& p, const std::array<float, 3>& change, Vector& du, Vector& dv) const {
    const Vector scale = hn::Div(set(1), p.z), x = hn::Mul(p.x, scale), y = hn::Mul(p.y, scale);
    const Vector dx = hn::Mul(scale, hn::NegMulAdd(x, set(change[2]), set(change[0])));
    const Vector dy = hn::Mul(scale, hn::NegMulAdd(y, set(change[2]), set(change[1])));
    const Vector rr = hn::MulAdd(x, x, hn::Mul(y, y)), half_drr = hn::MulAdd(x, dx, hn::Mul(y, dy));
    const Vector dxy = hn::MulAdd(x, dy, hn::Mul(y, dx)), radial = radial_at(rr);
    const Vector slope = hn::MulAdd(rr, hn::MulAdd(rr, set(3 * lens_.k3), set(2 * lens_.k2)), set(lens_.k1));
    const Vector dradial = hn::Mul(set(2), hn::Mul(half_drr, slope));
    const auto tangential = [&](float same, float other, Vector q, Vector dq) {
      const Vector drr = hn::MulAdd(hn::Mul(set(2), q), dq, half_drr);
      return hn::MulAdd(set(2 * same), dxy, hn::Mul(set(2 * other), drr));
    };
    du = hn::Mul(set(lens_.fx), hn::MulAdd(dx, radial, hn::MulAdd(x, dradial, tangential(lens_.p1, lens_.p2, x, dx))));
    dv = hn::Mul(set(lens_.fy), hn::MulAdd(dy, radial, hn::MulAdd(y, dradial, tangential(lens_.p2, lens_.p1, y, dy))));
  }

 private:
  HWY_INLINE Vector radial_at(Vector rr) const {
    return hn::MulAdd(rr, hn::MulAdd(rr, hn::MulAdd(rr, set(lens_.k3), set(lens_.k2)), set(lens_.k1)), set(1));
  }

  const LensNumbers& lens_;
};

/// The point at inverse depth w of a ray, up to scale.
HWY_INLINE Vector3 point_at(const Vector3& direction, const std::array<float, 3>& origin, Vector w) {
  return {hn::MulAdd(w, set(origin[0]), direction.x), hn::MulAdd(w, set(origin[1]), direction.y),
          hn::MulAdd(w, set(origin[2]), direction.z)};
}

/// Some of the batch's pixels. Over the few pixels that are followed, their curves are straight: a lens bends them by
/// less than a hundredth of a pixel there. Places are [px] from the expected one, towards nearer points.
class Curves {
 public:
  static constexpr float farthest = 6;  ///< [px]

  HWY_INLINE Curves(const CurveBatch& batch, std::size_t first) : picture_(batch.times), time_(at(batch.time, first)) {
    const Vector x = at(batch.ray_x, first), y = at(batch.ray_y, first), expected = at(batch.expected, first);
    const auto row = [&](std::size_t i) {
      const auto& r = batch.rotation;
      return hn::MulAdd(set(r[i]), x, hn::MulAdd(set(r[i + 1]), y, set(r[i + 2])));
    };
    const Vector3 point = point_at({row(0), row(3), row(6)}, batch.origin, expected);
    const Lens lens(batch.lens);
    const Imaged imaged = lens.image(point);
    lens.move(point, batch.origin, du_, dv_);
    inverse_speed_ = hn::Div(set(1), hn::Sqrt(hn::MulAdd(du_, du_, hn::Mul(dv_, dv_))));
    du_ = hn::Mul(du_, inverse_speed_);
    dv_ = hn::Mul(dv_, inverse_speed_);
    u_ = hn::IfThenElse(imaged.valid, imaged.u, no_number());
    v_ = imaged.v;
    expected_ = expected;
  }

  static HWY_INLINE Vector at(const CurveBatch::Each<float>& values, std::size_t first) {
    return hn::LoadU(Floats(), &values[first]);
  }
  HWY_INLINE Place place(Vector s) const { return picture_.at(hn::MulAdd(s, du_, u_), hn::MulAdd(s, dv_, v_)); }
  HWY_INLINE Vector inverse_depth(Vector s) const { return hn::MulAdd(s, inverse_speed_, expected_); }
  /// How far the other camera's time is ahead of the pixel's; NaN where there is none.
  HWY_INLINE Vector ahead(Vector s) const {
    const Place there = place(s);
    return hn::Sub(picture_.time(there, SideBySide(picture_.times().width, picture_.times().height, there)), time_);
  }
  const Picture& picture() const { return picture_; }

 private:
  const Picture picture_;
  Vector time_, u_, v_, du_, dv_, expected_, inverse_speed_;
};

/// The place where the times are equal; NaN where secants do not lead there.
HWY_INLINE Vector find_root(const Curves& curves, Vector slope) {
  const Floats d;
  Vector before = set(0), at_before = curves.ahead(before);
  if (!hn::AllTrue(d, hn::Or(hn::Eq(slope, slope), hn::IsNaN(at_before))))
    slope = hn::IfThenElse(hn::Eq(slope, slope), slope, hn::Sub(curves.ahead(set(1)), at_before));
  // The neighbourhood predicts the place, give or take half as much and half a pixel. What leads elsewhere is left out.
  const Vector middle = hn::Neg(hn::Div(at_before, slope));
  const Vector reach = hn::MulAdd(set(0.5f), hn::Abs(middle), set(0.5f));
  const auto is_near = [&](Vector s) {
    return hn::And(hn::Le(hn::Abs(hn::Sub(s, middle)), reach), hn::Le(hn::Abs(s), set(Curves::farthest)));
  };
  constexpr float precise = 5e-3f;  // [px]
  Vector here = hn::IfThenElse(is_near(middle), middle, no_number()), root = no_number();
  for (int tries = 0; tries < 6; ++tries) {
    const Vector at_here = curves.ahead(here);
    const Vector secant = hn::Div(hn::Mul(at_here, hn::Sub(before, here)), hn::Sub(at_here, at_before));
    const Vector move = hn::IfThenZeroElse(hn::Eq(at_here, set(0)), secant), next = hn::Add(here, move);
    const Mask near = is_near(next), arrived = hn::And(near, hn::Lt(hn::Abs(move), set(precise)));
    root = hn::IfThenElse(hn::And(arrived, hn::IsNaN(root)), next, root);
    before = here;
    at_before = at_here;
    here = hn::IfThenElse(hn::AndNot(arrived, near), next, no_number());
    if (hn::AllTrue(d, hn::IsNaN(here))) break;
  }
  return root;
}

void FollowCurves(CurveBatch& batch) {
  const Floats d;
  for (std::size_t first = 0; first < most_curves; first += hn::Lanes(d)) {
    const Curves curves(batch, first);
    const auto load = [&](const CurveBatch::Each<float>& values) { return Curves::at(values, first); };
    const auto store = [&](Vector v, CurveBatch::Each<float>& values) { hn::StoreU(v, d, &values[first]); };
    const Vector root = find_root(curves, load(batch.expected_slope)), inverse_depth = curves.inverse_depth(root);
    const Picture& picture = curves.picture();
    const Place place = curves.place(root);
    const auto time_at = [&](float px) {
      const Place there = curves.place(hn::Add(root, set(px)));
      return picture.linked_time(there, SideBySide(batch.times.width, batch.times.height, there));
    };
    // Over two pixels: over less, noise would be taken for slope. NaN beside a gap or the border.
    const SideBySide pixels(batch.times.width, batch.times.height, place);
    const Vector linked = pixels.pixel(batch.times.between);
    const Vector slope = hn::MulAdd(set(0.5f), hn::Sub(time_at(1), time_at(-1)), linked);
    const Vector sigma = load(batch.sigma),
                 noise = hn::MulAdd(sigma, sigma, variance(pixels.corners(batch.times.sigma), place));
    const Vector contrast = hn::Div(between(pixels.corners(batch.times.amplitude), place),
                                    hn::Mul(set(batch.brightness), load(batch.amplitude)));
    const auto is_alike =
        hn::And(hn::Lt(contrast, set(batch.most_contrast)), hn::Gt(contrast, set(1 / batch.most_contrast)));
    const auto is_allowed = hn::And(hn::Ge(inverse_depth, set(batch.far)), hn::Le(inverse_depth, set(batch.near)));
    const auto is_good = hn::And(hn::And(is_allowed, is_alike), hn::Eq(slope, slope));
    store(hn::IfThenElse(is_good, inverse_depth, no_number()), batch.inverse_depth);
    store(place.u, batch.u);
    store(place.v, batch.v);
    store(slope, batch.slope);
    store(hn::Div(hn::Sqrt(noise), hn::Abs(slope)), batch.sigma_px);
  }
}

/// Places on one curve, a stretch of them at a time.
class CurveSearch {
 public:
  CurveSearch(const TimeArrays& times, const LensNumbers& lens, const CurvePlaces& line, float time)
      : picture_(times),
        lens_(lens),
        line_(line),
        direction_{set(line.direction[0]), set(line.direction[1]), set(line.direction[2])},
        time_(time) {}

  /// Looks closely where the time may be that is looked for, and else nowhere.
  bool operator()(std::vector<std::size_t>& changes) const {
    const std::size_t stretches = (line_.count + stretch - 1) / stretch, lanes = hn::Lanes(Floats());
    const std::size_t at_once = std::max<std::size_t>(1, lanes - 1);
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

  HWY_INLINE Imaged image(Vector k) const {
    const Vector w = hn::MulAdd(hn::Min(k, set(static_cast<float>(line_.count))), set(line_.step), set(line_.first));
    return lens_.image(point_at(direction_, line_.origin, w));
  }
  HWY_INLINE Place place_of(const Imaged& imaged) const {
    return picture_.at(hn::IfThenElse(imaged.valid, imaged.u, no_number()), imaged.v);
  }

  bool sees_any() const {
    bool seen = false;
    for (std::size_t k = 0; k <= line_.count && !seen; k += hn::Lanes(Floats()))
      seen = !hn::AllFalse(Floats(), place_of(image(hn::Iota(Floats(), static_cast<float>(k)))).inside);
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
    const Imaged middle = image(hn::MulAdd(index, set(length), set(0.5f * length)));
    HWY_ALIGN float u[most_curves + 1], v[most_curves + 1];
    hn::StoreU(middle.u, d, u);
    hn::StoreU(middle.v, d, v);
    u[hn::Lanes(d)] = v[hn::Lanes(d)] = 0;
    const auto near = [&](const float* p, Vector here) {
      return hn::Le(hn::Abs(hn::Sub(hn::LoadU(d, p + 1), here)), set(farthest));
    };
    const Mask even = hn::And(hn::And(near(u, middle.u), near(v, middle.v)), middle.valid);
    const Mask hopeful = hn::Or(may_have_time(middle), hn::Not(even));
    std::uint8_t bits[8] = {};
    hn::StoreMaskBits(d, hopeful, bits);
    return {static_cast<unsigned>(bits[0] | bits[1] << 8), !hn::AllFalse(d, place_of(middle).inside)};
  }

  /// \return where the blocks around a place have times before and after
  HWY_INLINE Mask may_have_time(const Imaged& place) const {
    const Integers d;
    constexpr float share = 1.0f / time_block_px, rounding = 1e-3f;  // [frames]
    const int rows = (picture_.times().height + time_block_px - 1) / time_block_px;
    const auto block = [&](Vector p, int blocks) {
      const Vector inside = hn::Min(hn::Max(hn::Mul(p, set(share)), set(0)), set(static_cast<float>(blocks - 1)));
      return hn::ConvertTo(d, hn::IfThenElseZero(place.valid, inside));
    };
    const auto index = hn::Add(hn::Mul(block(place.v, rows), hn::Set(d, picture_.times().blocks)),
                               block(place.u, picture_.times().blocks));
    return hn::And(hn::Le(hn::GatherIndex(Floats(), picture_.times().earliest, index), set(time_ + rounding)),
                   hn::Ge(hn::GatherIndex(Floats(), picture_.times().latest, index), set(time_ - rounding)));
  }

  /// \return whether any of the places of a stretch is seen
  bool compare(std::size_t first, std::vector<std::size_t>& changes) const {
    const Floats d;
    bool seen = false;
    HWY_ALIGN float ahead[most_curves];
    for (std::size_t k = 0; k < most_curves; k += hn::Lanes(d)) {
      const Place place = place_of(image(hn::Iota(d, static_cast<float>(first + k))));
      seen = seen || !hn::AllFalse(d, place.inside);
      hn::StoreU(hn::Sub(picture_.linked_time(place, Scattered(picture_.times().width, place)), set(time_)), d,
                 ahead + k);
    }
    const std::size_t steps = std::min(stretch, line_.count - first);
    for (std::size_t k = 0; k < steps; ++k)
      if (ahead[k] * ahead[k + 1] <= 0) changes.push_back(first + k);
    return seen;
  }

  const Picture picture_;
  const Lens lens_;
  const CurvePlaces& line_;
  const Vector3 direction_;
  const float time_;
};

bool SearchCurve(const TimeArrays& times, const LensNumbers& lens, const CurvePlaces& line, float time,
                 std::vector<std::size_t>& changes) {
  changes.clear();
  return CurveSearch(times, lens, line, time)(changes);
}

}  // namespace pagesweep::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pagesweep {

HWY_EXPORT(FollowCurves);
HWY_EXPORT(SearchCurve);

void follow_curves(CurveBatch& batch) { HWY_DYNAMIC_DISPATCH(FollowCurves)(batch); }

bool search_curve(const TimeArrays& times, const LensNumbers& lens, const CurvePlaces& line, float time,
                  std::vector<std::size_t>& changes) {
  return HWY_DYNAMIC_DISPATCH(SearchCurve)(times, lens, line, time, changes);
}

}  // namespace pagesweep
#endif
