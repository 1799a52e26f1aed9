// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <limits>

#include "pagesweep/camera/undistort_internal.h"

// Not worth their time to compile beside SSE4, AVX2 and AVX-512.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pagesweep/camera/undistort.cc"
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace pagesweep::HWY_NAMESPACE {
namespace {
namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t most_at_once = 8;
using Doubles = hn::CappedTag<double, most_at_once>;
using Vector = hn::Vec<Doubles>;

Vector set(double value) { return hn::Set(Doubles(), value); }
Vector twice(Vector v) { return hn::Add(v, v); }

/// Goes along a row, from where the pixels before let expect the next ones.
class RowInverter {
 public:
  explicit RowInverter(const BrownConrady& lens) : lens_(lens), shift_x_(set(0)), shift_y_(set(0)) {}

  /// Newton steps until the next one would be below rounding.
  void invert(Vector u, Vector v, Vector& x, Vector& y) {
    constexpr int most_steps = 8;
    constexpr double near = 1e-14, farthest = 16;  // squared: the error after a step is about the square of that before
    x = hn::Add(u, shift_x_), y = hn::Add(v, shift_y_);
    auto found = hn::MaskFromVec(set(0));
    for (int i = 0; i < most_steps && !hn::AllTrue(Doubles(), found); ++i) {
      const Vector error = step(u, v, x, y);
      found = hn::Lt(error, set(near));
    }
    const Vector rr = hn::MulAdd(x, x, hn::Mul(y, y));
    found = hn::And(found, hn::Lt(rr, set(farthest)));
    shift_x_ = hn::IfThenElseZero(found, hn::Sub(x, u));
    shift_y_ = hn::IfThenElseZero(found, hn::Sub(y, v));
    const Vector nowhere = set(std::numeric_limits<double>::quiet_NaN());
    x = hn::IfThenElse(found, x, nowhere);
    y = hn::IfThenElse(found, y, nowhere);
  }

 private:
  /// See BrownConrady::distort() and jacobian(). \return squared distance from (u, v) before the step
  Vector step(Vector u, Vector v, Vector& x, Vector& y) const {
    const Vector xx = hn::Mul(x, x), yy = hn::Mul(y, y), xy = hn::Mul(x, y), rr = hn::Add(xx, yy);
    const auto polynomial = [&](double c0, double c1, double c2) {
      return hn::MulAdd(rr, hn::MulAdd(rr, set(c2), set(c1)), set(c0));
    };
    const Vector radial = hn::MulAdd(rr, polynomial(lens_.k1, lens_.k2, lens_.k3), set(1));
    const Vector slope = polynomial(2 * lens_.k1, 4 * lens_.k2, 6 * lens_.k3);
    const Vector p1 = set(lens_.p1), p2 = set(lens_.p2);
    const Vector tangent_x = hn::MulAdd(p1, twice(xy), hn::Mul(p2, hn::Add(rr, twice(xx))));
    const Vector tangent_y = hn::MulAdd(p2, twice(xy), hn::Mul(p1, hn::Add(rr, twice(yy))));
    const Vector error_x = hn::Sub(hn::MulAdd(x, radial, tangent_x), u);
    const Vector error_y = hn::Sub(hn::MulAdd(y, radial, tangent_y), v);
    const Vector px = hn::MulAdd(p1, y, hn::Mul(set(3 * lens_.p2), x)),
                 py = hn::MulAdd(set(3 * lens_.p1), y, hn::Mul(p2, x));
    const Vector a = hn::MulAdd(xx, slope, hn::Add(radial, twice(px)));
    const Vector d = hn::MulAdd(yy, slope, hn::Add(radial, twice(py)));
    const Vector b = hn::MulAdd(xy, slope, twice(hn::MulAdd(p1, x, hn::Mul(p2, y))));
    const Vector scale = hn::Div(set(1), hn::MulSub(a, d, hn::Mul(b, b)));
    x = hn::NegMulAdd(scale, hn::MulSub(d, error_x, hn::Mul(b, error_y)), x);
    y = hn::NegMulAdd(scale, hn::MulSub(a, error_y, hn::Mul(b, error_x)), y);
    return hn::MulAdd(error_x, error_x, hn::Mul(error_y, error_y));
  }

  const BrownConrady& lens_;
  Vector shift_x_, shift_y_;
};

void UndistortRow(const BrownConrady& lens, const PixelRow& row, std::span<Eigen::Vector2d> ideal) {
  const std::size_t lanes = hn::Lanes(Doubles());
  RowInverter inverter(lens);
  alignas(64) std::array<double, most_at_once> xs, ys;
  for (std::size_t k = 0; k < ideal.size(); k += lanes) {
    const Vector place = hn::Iota(Doubles(), static_cast<double>(k));
    Vector x, y;
    inverter.invert(hn::MulAdd(place, set(row.step), set(row.x)), set(row.y), x, y);
    hn::Store(x, Doubles(), xs.data());
    hn::Store(y, Doubles(), ys.data());
    for (std::size_t i = 0; i < lanes && k + i < ideal.size(); ++i) ideal[k + i] = {xs[i], ys[i]};
  }
}

}  // namespace
}  // namespace pagesweep::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pagesweep {

HWY_EXPORT(UndistortRow);

void undistort_row(const BrownConrady& lens, const PixelRow& row, std::span<Eigen::Vector2d> ideal) {
  HWY_DYNAMIC_DISPATCH(UndistortRow)(lens, row, ideal);
}

}  // namespace pagesweep
#endif  // HWY_ONCE
