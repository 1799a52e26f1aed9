// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/base/plane_sums_internal.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

// Not worth their time to compile beside SSE4, AVX2 and AVX-512.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pagesweep/base/plane_sums.cc"
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace pagesweep::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Floats = hn::CappedTag<float, plane_padding>;
using Vector = hn::Vec<Floats>;

float total(Vector v) { return hn::GetLane(hn::SumOfLanes(Floats(), v)); }

Vector at(const LocalPlane& plane, Vector i, Vector j) {
  const Floats d;
  return hn::MulAdd(hn::Set(d, plane.across), i, hn::MulAdd(hn::Set(d, plane.down), j, hn::Set(d, plane.middle)));
}

PlaneSums SumNear(const PlanePlaces& places, const LocalPlane& before, float limit) {
  const Floats d;
  Vector n = hn::Zero(d), si = n, sj = n, sii = n, sij = n, sjj = n, sd = n, sid = n, sjd = n;
  for (std::size_t k = 0; k < places.count; k += hn::Lanes(d)) {
    const Vector i = hn::LoadU(d, places.i + k), j = hn::LoadU(d, places.j + k), value = hn::LoadU(d, places.value + k);
    const auto use = hn::Le(hn::Abs(hn::Sub(value, at(before, i, j))), hn::Set(d, limit));  // false for NaN
    const Vector ui = hn::IfThenElseZero(use, i), uj = hn::IfThenElseZero(use, j);
    const Vector uv = hn::IfThenElseZero(use, value);
    n = hn::Add(n, hn::IfThenElseZero(use, hn::Set(d, 1.0f)));
    si = hn::Add(si, ui);
    sj = hn::Add(sj, uj);
    sii = hn::MulAdd(ui, i, sii);
    sij = hn::MulAdd(ui, j, sij);
    sjj = hn::MulAdd(uj, j, sjj);
    sd = hn::Add(sd, uv);
    sid = hn::MulAdd(uv, i, sid);
    sjd = hn::MulAdd(uv, j, sjd);
  }
  return {total(n), total(si), total(sj), total(sii), total(sij), total(sjj), total(sd), total(sid), total(sjd)};
}

/// How many of the values, as bits, are above `level`. No-values are negative.
std::size_t count_above(const std::int32_t* bits, std::size_t count, std::int32_t level) {
  const hn::CappedTag<std::int32_t, plane_padding> d;
  std::size_t above = 0;
  for (std::size_t k = 0; k < count; k += hn::Lanes(d))
    above += hn::CountTrue(d, hn::Gt(hn::LoadU(d, bits + k), hn::Set(d, level)));
  return above;
}

/// Not negative floats are ordered as their bits are, which are bisected.
float median_of(const float* misses, std::size_t count, float largest) {
  const auto* bits = reinterpret_cast<const std::int32_t*>(misses);
  constexpr std::int32_t octave = 1 << 23, precise = 1 << 16;
  const std::size_t size = count_above(bits, count, -1), most_above = size - size / 2 - 1;
  std::int32_t high = std::bit_cast<std::int32_t>(largest), low = std::max(0, high - 6 * octave);
  if (count_above(bits, count, low) <= most_above) {
    high = low;
    low = 0;
  }
  while (high - low > precise) {
    const std::int32_t middle = low + (high - low) / 2;
    (count_above(bits, count, middle) <= most_above ? high : low) = middle;
  }
  return std::bit_cast<float>(high);
}

Misses FindMisses(const PlanePlaces& places, const LocalPlane& plane, float* scratch) {
  const Floats d;
  Vector largest = hn::Zero(d);
  for (std::size_t k = 0; k < places.count; k += hn::Lanes(d)) {
    const Vector i = hn::LoadU(d, places.i + k), j = hn::LoadU(d, places.j + k), value = hn::LoadU(d, places.value + k);
    const Vector miss = hn::Abs(hn::Sub(value, at(plane, i, j)));
    const Vector known = hn::IfThenElse(hn::IsNaN(miss), hn::Set(d, -1.0f), miss);
    largest = hn::Max(largest, known);
    hn::StoreU(known, d, scratch + k);
  }
  const float most = hn::GetLane(hn::MaxOfLanes(d, largest));
  return {median_of(scratch, places.count, most), most};
}

}  // namespace pagesweep::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pagesweep {

HWY_EXPORT(SumNear);
HWY_EXPORT(FindMisses);

PlaneSums sum_near(const PlanePlaces& places, const LocalPlane& before, float limit) {
  return HWY_DYNAMIC_DISPATCH(SumNear)(places, before, limit);
}

Misses find_misses(const PlanePlaces& places, const LocalPlane& plane, float* scratch) {
  return HWY_DYNAMIC_DISPATCH(FindMisses)(places, plane, scratch);
}

}  // namespace pagesweep
#endif
