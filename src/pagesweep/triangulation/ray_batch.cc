// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Core>
#include <limits>

#include "pagesweep/triangulation/ray_batch_internal.h"

// Not worth their time to compile beside SSE4, AVX2 and AVX-512.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pagesweep/triangulation/ray_batch.cc"
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace pagesweep::HWY_NAMESPACE {
namespace {
namespace hn = hwy::HWY_NAMESPACE;

using Doubles = hn::CappedTag<double, 8>;
using Vector = hn::Vec<Doubles>;

HWY_INLINE Vector set(double value) { return hn::Set(Doubles(), value); }

struct Vector3 {
  Vector x, y, z;
};

HWY_INLINE Vector dot(const Vector3& a, const Vector3& b) {
  return hn::MulAdd(a.x, b.x, hn::MulAdd(a.y, b.y, hn::Mul(a.z, b.z)));
}

/// The point from + s direction.
HWY_INLINE Vector3 along(const std::array<double, 3>& from, Vector s, const Vector3& direction) {
  return {hn::MulAdd(s, direction.x, set(from[0])), hn::MulAdd(s, direction.y, set(from[1])),
          hn::MulAdd(s, direction.z, set(from[2]))};
}

/// The direction (x, y, 1) in another frame.
HWY_INLINE Vector3 turn(const std::array<double, 9>& r, Vector x, Vector y) {
  const auto row = [&](std::size_t i) { return hn::MulAdd(set(r[i]), x, hn::MulAdd(set(r[i + 1]), y, set(r[i + 2]))); };
  return {row(0), row(3), row(6)};
}

/// [px per unit of length] Speed of the picture of a point that moves: the projection's derivative.
HWY_INLINE Vector picture_speed(const RayPair& cameras, const Vector3& point, const Vector3& move, Vector x, Vector y) {
  const BrownConrady& lens = cameras.lens;
  const Vector scale = hn::Div(set(1), point.z);
  const Vector dx = hn::Mul(scale, hn::NegMulAdd(x, move.z, move.x));
  const Vector dy = hn::Mul(scale, hn::NegMulAdd(y, move.z, move.y));
  const Vector rr = hn::MulAdd(x, x, hn::Mul(y, y)), half_drr = hn::MulAdd(x, dx, hn::Mul(y, dy));
  const Vector dxy = hn::MulAdd(x, dy, hn::Mul(y, dx)), two = set(2);
  const Vector radial =
      hn::MulAdd(rr, hn::MulAdd(rr, hn::MulAdd(rr, set(lens.k3), set(lens.k2)), set(lens.k1)), set(1));
  const Vector slope = hn::MulAdd(rr, hn::MulAdd(rr, set(3 * lens.k3), set(2 * lens.k2)), set(lens.k1));
  const Vector dradial = hn::Mul(two, hn::Mul(half_drr, slope));
  const auto tangential = [&](double same, double other, Vector p, Vector dp) {
    const Vector drr = hn::MulAdd(hn::Mul(two, p), dp, half_drr);
    return hn::Mul(two, hn::MulAdd(set(same), dxy, hn::Mul(set(other), drr)));
  };
  const Vector du = hn::MulAdd(dx, radial, hn::MulAdd(x, dradial, tangential(lens.p1, lens.p2, x, dx)));
  const Vector dv = hn::MulAdd(dy, radial, hn::MulAdd(y, dradial, tangential(lens.p2, lens.p1, y, dy)));
  const Vector u = hn::Mul(set(cameras.fx), du), v = hn::Mul(set(cameras.fy), dv);
  return hn::Sqrt(hn::MulAdd(u, u, hn::Mul(v, v)));
}

/// In the second camera's frame, with b its ray and t + l a the first one, l is the depth along the first camera's
/// axis, for a is (x, y, 1) turned.
void intersect_some(const RayPair& cameras, std::size_t first, RayBatch& rays) {
  const auto load = [&](const RayBatch::Each& values) { return hn::Load(Doubles(), &values[first]); };
  const auto store = [&](Vector v, RayBatch::Each& values) { hn::Store(v, Doubles(), &values[first]); };
  const Vector x = load(rays.first_x), y = load(rays.first_y);
  const Vector3 a = turn(cameras.to_from_from, x, y), b{load(rays.second_x), load(rays.second_y), set(1)};
  const Vector3 t{set(cameras.origin[0]), set(cameras.origin[1]), set(cameras.origin[2])};
  const Vector aa = dot(a, a), bb = dot(b, b), ab = dot(a, b), ta = dot(t, a), tb = dot(t, b);
  const Vector squares = hn::Mul(aa, bb), determinant = hn::NegMulAdd(ab, ab, squares);
  const Vector depth = hn::Div(hn::MulSub(tb, ab, hn::Mul(ta, bb)), determinant);
  const Vector other = hn::Div(hn::MulSub(tb, aa, hn::Mul(ta, ab)), determinant);
  const Vector3 point = along(cameras.origin, depth, a);
  const auto meets = hn::And(hn::And(hn::Gt(depth, set(0)), hn::Gt(other, set(0))),
                             hn::And(hn::Gt(determinant, hn::Mul(set(1e-12), squares)), hn::Gt(point.z, set(0))));
  store(hn::IfThenElse(meets, depth, set(std::numeric_limits<double>::quiet_NaN())), rays.depth);

  const Vector3 gap{hn::NegMulAdd(other, b.x, point.x), hn::NegMulAdd(other, b.y, point.y), hn::Sub(point.z, other)};
  store(hn::Mul(set(cameras.fx), hn::Sqrt(hn::Div(dot(gap, gap), dot(point, point)))), rays.gap_px);
  const Vector ideal_x = hn::Div(point.x, point.z), ideal_y = hn::Div(point.y, point.z);
  store(hn::MulAdd(ideal_x, ideal_x, hn::Mul(ideal_y, ideal_y)), rays.radius_squared);
  store(hn::Div(picture_speed(cameras, point, a, ideal_x, ideal_y), hn::Sqrt(aa)), rays.pixels_per_mm);
  const Vector3 in_rig = along(cameras.center, depth, turn(cameras.rig_from_from, x, y));
  store(in_rig.x, rays.x);
  store(in_rig.y, rays.y);
  store(in_rig.z, rays.z);
}

void Intersect(const RayPair& cameras, RayBatch& rays) {
  for (std::size_t first = 0; first < rays.count; first += hn::Lanes(Doubles())) intersect_some(cameras, first, rays);
}

}  // namespace
}  // namespace pagesweep::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pagesweep {

HWY_EXPORT(Intersect);

RayPair::RayPair(const Camera& from, const Camera& to) : fx(to.fx), fy(to.fy), lens(to.distortion) {
  const Rigid3 to_from = to.cam_from_rig * from.cam_from_rig.inverse(), rig_from = from.cam_from_rig.inverse();
  using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  Eigen::Map<RowMajor>(to_from_from.data()) = to_from.rotation;
  Eigen::Map<RowMajor>(rig_from_from.data()) = rig_from.rotation;
  Eigen::Map<Eigen::Vector3d>(origin.data()) = to_from.translation;
  Eigen::Map<Eigen::Vector3d>(center.data()) = rig_from.translation;
}

void intersect(const RayPair& cameras, RayBatch& rays) { HWY_DYNAMIC_DISPATCH(Intersect)(cameras, rays); }

}  // namespace pagesweep
#endif  // HWY_ONCE
