// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "pagesweep/footprint/spot_sums_internal.h"

// Not worth their time to compile beside SSE4, AVX2 and AVX-512.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pagesweep/footprint/spot_sums.cc"
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>
// After those two.
#include <hwy/contrib/math/math-inl.h>

HWY_BEFORE_NAMESPACE();
namespace pagesweep::HWY_NAMESPACE {
namespace {
namespace hn = hwy::HWY_NAMESPACE;

using Floats = hn::CappedTag<float, spot_padding>;
using Vector = hn::Vec<Floats>;
constexpr int lanes = hn::MaxLanes(Floats());

Vector set(float value) { return hn::Set(Floats(), value); }

/// Light between four pixels. Those that do not count need not be there.
struct Cell {
  float right, down;  ///< [px] from the first of them

  Vector at(const float* pixel, std::ptrdiff_t stride) const {
    const auto row = [&](const float* first) {
      const Vector here = hn::LoadU(Floats(), first);
      return right == 0 ? here : hn::MulAdd(set(right), hn::Sub(hn::LoadU(Floats(), first + 1), here), here);
    };
    const Vector above = row(pixel);
    return down == 0 ? above : hn::MulAdd(set(down), hn::Sub(row(pixel + stride), above), above);
  }
};

/// The places that are as far from their pixel as the cell says.
class Sums {
 public:
  Sums() : light_(hn::Zero(Floats())), u_(light_), v_(light_) {}

  void add(const LightArray& corner, const GaussianSpot& spot, const Cell& cell) {
    alignas(64) static constexpr float ahead[spot_padding] = {0, 1, 2, 3, 4, 5, 6, 7};
    const auto step = static_cast<float>(spot.row_step);
    const bool by_ratio = spot.weighs_everywhere();
    const Vector shrinks = hn::Exp(Floats(), set(-spot.vv * step * step));
    for (int column = 0; column < spot.columns; column += lanes) {
      const Vector i = hn::Add(hn::Load(Floats(), ahead), set(static_cast<float>(column) + cell.right - spot.u));
      const float first = cell.down - spot.v;
      Weights weights{weight_of(square_at(spot, i, first)), shrinks, shrinks};
      if (by_ratio) weights.ratio = weight_of(hn::Sub(square_at(spot, i, first + step), square_at(spot, i, first)));
      for (int row = 0; row < spot.rows; row += spot.row_step) {
        const float j = first + static_cast<float>(row);
        const Vector square = square_at(spot, i, j), weight = by_ratio ? weights.next() : weight_of(square);
        const Vector light = cell.at(corner.first + row * corner.stride + column, corner.stride);
        const Vector weighed = hn::IfThenElseZero(hn::Le(square, set(spot.most)), hn::Mul(weight, light));
        light_ = hn::Add(light_, weighed);
        u_ = hn::MulAdd(weighed, i, u_);
        v_ = hn::MulAdd(weighed, set(j), v_);
      }
    }
  }

  SpotSums total() const {
    const auto sum = [](Vector v) { return hn::GetLane(hn::SumOfLanes(Floats(), v)); };
    return {sum(light_), sum(u_), sum(v_)};
  }

 private:
  /// Down a column, each weight is the one above times a ratio that itself shrinks evenly.
  struct Weights {
    Vector weight, ratio, shrinks;
    HWY_INLINE Vector next() {
      const Vector here = weight;
      weight = hn::Mul(weight, ratio);
      ratio = hn::Mul(ratio, shrinks);
      return here;
    }
  };
  static HWY_INLINE Vector square_at(const GaussianSpot& spot, Vector i, float j) {
    return hn::MulAdd(i, hn::MulAdd(i, set(spot.uu), set(2 * spot.uv * j)), set(spot.vv * j * j));
  }
  static HWY_INLINE Vector weight_of(Vector square) { return hn::Exp(Floats(), hn::Mul(set(-0.5f), square)); }

  Vector light_, u_, v_;
};

SpotSums SumSpot(const LightArray& corner, const GaussianSpot& spot) {
  Sums sums;
  const float step = 1 / static_cast<float>(spot.parts);
  for (int down = 0; down < spot.parts; ++down)
    for (int right = 0; right < spot.parts; ++right)
      sums.add(corner, spot, {step * static_cast<float>(right), step * static_cast<float>(down)});
  return sums.total();
}

}  // namespace
}  // namespace pagesweep::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pagesweep {

HWY_EXPORT(SumSpot);

bool GaussianSpot::weighs_everywhere() const {
  const auto across = std::max(u, static_cast<float>(columns + spot_padding) - u);
  const auto down = std::max(v, static_cast<float>(rows + row_step) - v);
  constexpr float far = 100;  // what weighs exp(-far / 2) is still a normal number
  return uu * across * across + 2 * std::abs(uv) * across * down + vv * down * down < far;
}

SpotSums sum_spot(const LightArray& corner, const GaussianSpot& spot) {
  return HWY_DYNAMIC_DISPATCH(SumSpot)(corner, spot);
}

}  // namespace pagesweep
#endif  // HWY_ONCE
