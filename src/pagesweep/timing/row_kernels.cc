// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/row_kernels_internal.h"

#include <algorithm>
#include <limits>
#include <type_traits>

// Not worth their time to compile beside SSE4, AVX2 and AVX-512.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pagesweep/timing/row_kernels.cc"
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace pagesweep::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Floats = hn::CappedTag<float, tile_pixels>;
using Vector = hn::Vec<Floats>;

template <class T>
using Rows = std::span<const T* const>;

/// Sums in integers as narrow as can hold them.
template <class T>
void SumRows(Rows<T> rows, int left, float factor, std::span<float> sums) {
  using Sum = std::conditional_t<sizeof(T) == 1, std::uint16_t, std::uint32_t>;
  const hn::ScalableTag<Sum> wide;
  const hn::Rebind<T, decltype(wide)> narrow;
  HWY_ALIGN Sum totals[hn::MaxLanes(wide)];
  std::size_t x = 0;
  for (; x + hn::Lanes(wide) <= sums.size(); x += hn::Lanes(wide)) {
    const std::size_t at = static_cast<std::size_t>(left) + x;
    auto total = hn::Zero(wide);
    for (const T* row : rows) total = hn::Add(total, hn::PromoteTo(wide, hn::LoadU(narrow, row + at)));
    hn::Store(total, wide, totals);
    for (std::size_t k = 0; k < hn::Lanes(wide); ++k) sums[x + k] = factor * static_cast<float>(totals[k]);
  }
  for (; x < sums.size(); ++x) {
    Sum total = 0;
    for (const T* row : rows) total = static_cast<Sum>(total + row[static_cast<std::size_t>(left) + x]);
    sums[x] = factor * static_cast<float>(total);
  }
}

template <class T>
void CountClipped(Rows<T> all_rows, T saturation, std::span<std::uint8_t> counts) {
  constexpr std::size_t rows_at_once = 8;  // long pieces of few rows are read faster than short ones of many
  const hn::ScalableTag<T> d;
  const auto lanes = hn::Lanes(d);
  const auto limit = hn::Set(d, saturation), one = hn::Set(d, T{1});
  HWY_ALIGN T clipped[hn::MaxLanes(d)];
  const auto add = [&](std::size_t at, unsigned many) {
    counts[at] = static_cast<std::uint8_t>(std::min(255U, counts[at] + many));
  };
  for (std::size_t first = 0; first < all_rows.size(); first += rows_at_once) {
    const Rows<T> rows = all_rows.subspan(first, std::min(rows_at_once, all_rows.size() - first));
    std::size_t x = 0;
    for (; x + lanes <= counts.size(); x += lanes) {
      auto highest = hn::Zero(d);
      for (const T* row : rows) highest = hn::Max(highest, hn::LoadU(d, row + x));
      // Unsigned a >= b where the larger of the two is a.
      if (hn::AllFalse(d, hn::Eq(hn::Max(highest, limit), highest))) continue;
      auto count = hn::Zero(d);
      for (const T* row : rows) {
        const auto gray = hn::LoadU(d, row + x);
        count = hn::Add(count, hn::IfThenElseZero(hn::Eq(hn::Max(gray, limit), gray), one));
      }
      hn::Store(count, d, clipped);
      for (std::size_t k = 0; k < lanes; ++k) add(x + k, clipped[k]);
    }
    for (; x < counts.size(); ++x)
      for (const T* row : rows) add(x, row[x] >= saturation);
  }
}

template <class D>
hn::Vec<D> response_at(D d, const Place& place, std::size_t x) {
  const auto at = [d, x](const float* sums) { return hn::LoadU(d, sums + x); };
  const auto& [middle, side, number] = place;
  const auto sides = hn::Add(hn::Add(at(side[0]), at(side[1])), hn::Add(at(side[2]), at(side[3])));
  const auto light = hn::Add(at(middle[0]), at(middle[1]));
  return hn::Sub(hn::Add(light, light), sides);
}

template <class D>
void keep_highest_of(D d, const Place* previous, std::span<const Place> places, const HighestRow& row, std::size_t x) {
  const hn::RebindToSigned<D> integers;
  const auto none = hn::Set(d, std::numeric_limits<float>::quiet_NaN());
  auto rise = hn::LoadU(d, row.rise + x), before = hn::LoadU(d, row.before + x), after = hn::LoadU(d, row.after + x);
  auto last = previous ? response_at(d, *previous, x) : none;
  auto best = hn::LoadU(integers, row.best + x);
  for (const Place& place : places) {
    const auto response = response_at(d, place, x);
    const auto higher = hn::Gt(response, rise);
    const auto follows = hn::RebindMask(d, hn::Eq(best, hn::Set(integers, place.number - 1)));
    after = hn::IfThenElse(follows, response, after);
    after = hn::IfThenElse(higher, none, after);
    before = hn::IfThenElse(higher, last, before);
    rise = hn::IfThenElse(higher, response, rise);
    best = hn::IfThenElse(hn::RebindMask(integers, higher), hn::Set(integers, place.number), best);
    last = response;
  }
  hn::StoreU(rise, d, row.rise + x);
  hn::StoreU(before, d, row.before + x);
  hn::StoreU(after, d, row.after + x);
  hn::StoreU(best, integers, row.best + x);
}

void KeepHighest(const Place* previous, std::span<const Place> places, const HighestRow& row, std::size_t count) {
  const Floats d;
  const hn::CappedTag<float, 1> single;
  std::size_t x = 0;
  for (; x + hn::Lanes(d) <= count; x += hn::Lanes(d)) keep_highest_of(d, previous, places, row, x);
  for (; x < count; ++x) keep_highest_of(single, previous, places, row, x);
}

Extremes ExtremesOf(const float* rise, const std::int32_t* best, std::size_t count) {
  const Floats d;
  const hn::RebindToSigned<Floats> integers;
  Extremes extremes{rise[0], best[0]};
  std::size_t x = 0;
  if (count >= hn::Lanes(d)) {
    auto lowest = hn::LoadU(d, rise);
    auto latest = hn::LoadU(integers, best);
    for (; x + hn::Lanes(d) <= count; x += hn::Lanes(d)) {
      lowest = hn::Min(lowest, hn::LoadU(d, rise + x));
      latest = hn::Max(latest, hn::LoadU(integers, best + x));
    }
    extremes = {hn::GetLane(hn::MinOfLanes(d, lowest)), hn::GetLane(hn::MaxOfLanes(integers, latest))};
  }
  for (; x < count; ++x) extremes = {std::min(extremes.lowest_rise, rise[x]), std::max(extremes.latest_best, best[x])};
  return extremes;
}

/// As many vectors as they have lanes become the vectors of their first, second, ... lanes: each pass turns the
/// address, vector number before lane number, by one bit.
template <class D>
void transpose(D d, hn::Vec<D>* vectors) {
#if HWY_TARGET != HWY_SCALAR
  const std::size_t lanes = hn::Lanes(d);
  for (std::size_t pass = 1; pass < lanes; pass *= 2) {
    hn::Vec<D> turned[tile_pixels];
    for (std::size_t k = 0; k < lanes / 2; ++k) {
      turned[k] = hn::ConcatEven(d, vectors[2 * k + 1], vectors[2 * k]);
      turned[k + lanes / 2] = hn::ConcatOdd(d, vectors[2 * k + 1], vectors[2 * k]);
    }
    std::copy_n(turned, lanes, vectors);
  }
#else
  (void)d;
  (void)vectors;
#endif
}

template <class T>
void TransposeRows(Rows<T> rows, int left, T* out, std::size_t stride) {
  const hn::CappedTag<T, tile_pixels> d;
  const std::size_t lanes = hn::Lanes(d);
  for (std::size_t first_pixel = 0; first_pixel < tile_pixels; first_pixel += lanes)
    for (std::size_t first = 0; first < rows.size(); first += lanes) {
      hn::Vec<decltype(d)> vectors[tile_pixels];
      for (std::size_t i = 0; i < lanes; ++i)
        vectors[i] = first + i < rows.size()
                         ? hn::LoadU(d, rows[first + i] + static_cast<std::size_t>(left) + first_pixel)
                         : hn::Zero(d);
      transpose(d, vectors);
      for (std::size_t p = 0; p < lanes; ++p) hn::StoreU(vectors[p], d, out + (first_pixel + p) * stride + first);
    }
}

template <class T>
float TakeOff(const T* gray, std::size_t count, float black, float* light) {
  const Floats d;
  const hn::Rebind<std::int32_t, Floats> integers;
  const hn::Rebind<T, Floats> raw;
  Vector highest = hn::Zero(d);
  std::size_t i = 0;
  for (; i + hn::Lanes(d) <= count; i += hn::Lanes(d)) {
    const Vector value = hn::ConvertTo(d, hn::PromoteTo(integers, hn::LoadU(raw, gray + i)));
    highest = hn::Max(highest, value);
    hn::StoreU(hn::Sub(value, hn::Set(d, black)), d, light + i);
  }
  float most = hn::GetLane(hn::MaxOfLanes(d, highest));
  for (; i < count; ++i) {
    const auto value = static_cast<float>(gray[i]);
    most = std::max(most, value);
    light[i] = value - black;
  }
  return most;
}

void SumRows8(Rows<std::uint8_t> rows, int left, float factor, std::span<float> sums) {
  SumRows(rows, left, factor, sums);
}
void SumRows16(Rows<std::uint16_t> rows, int left, float factor, std::span<float> sums) {
  SumRows(rows, left, factor, sums);
}
void CountClipped8(Rows<std::uint8_t> rows, std::uint8_t saturation, std::span<std::uint8_t> counts) {
  CountClipped(rows, saturation, counts);
}
void CountClipped16(Rows<std::uint16_t> rows, std::uint16_t saturation, std::span<std::uint8_t> counts) {
  CountClipped(rows, saturation, counts);
}
void TransposeRows8(Rows<std::uint8_t> rows, int left, std::uint8_t* out, std::size_t stride) {
  TransposeRows(rows, left, out, stride);
}
void TransposeRows16(Rows<std::uint16_t> rows, int left, std::uint16_t* out, std::size_t stride) {
  TransposeRows(rows, left, out, stride);
}
float TakeOff8(const std::uint8_t* gray, std::size_t count, float black, float* light) {
  return TakeOff(gray, count, black, light);
}
float TakeOff16(const std::uint16_t* gray, std::size_t count, float black, float* light) {
  return TakeOff(gray, count, black, light);
}

}  // namespace pagesweep::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pagesweep {

HWY_EXPORT(SumRows8);
HWY_EXPORT(SumRows16);
HWY_EXPORT(CountClipped8);
HWY_EXPORT(CountClipped16);
HWY_EXPORT(KeepHighest);
HWY_EXPORT(ExtremesOf);
HWY_EXPORT(TransposeRows8);
HWY_EXPORT(TransposeRows16);
HWY_EXPORT(TakeOff8);
HWY_EXPORT(TakeOff16);

void sum_rows(std::span<const std::uint8_t* const> rows, int left, float factor, std::span<float> sums) {
  HWY_DYNAMIC_DISPATCH(SumRows8)(rows, left, factor, sums);
}

void sum_rows(std::span<const std::uint16_t* const> rows, int left, float factor, std::span<float> sums) {
  HWY_DYNAMIC_DISPATCH(SumRows16)(rows, left, factor, sums);
}

void count_clipped_rows(std::span<const std::uint8_t* const> rows, std::uint8_t saturation,
                        std::span<std::uint8_t> counts) {
  HWY_DYNAMIC_DISPATCH(CountClipped8)(rows, saturation, counts);
}

void count_clipped_rows(std::span<const std::uint16_t* const> rows, std::uint16_t saturation,
                        std::span<std::uint8_t> counts) {
  HWY_DYNAMIC_DISPATCH(CountClipped16)(rows, saturation, counts);
}

void keep_highest(const Place* previous, std::span<const Place> places, const HighestRow& highest, std::size_t count) {
  HWY_DYNAMIC_DISPATCH(KeepHighest)(previous, places, highest, count);
}

Extremes extremes_of(const float* rise, const std::int32_t* best, std::size_t count) {
  return HWY_DYNAMIC_DISPATCH(ExtremesOf)(rise, best, count);
}

void transpose_rows(std::span<const std::uint8_t* const> rows, int left, std::uint8_t* out, std::size_t stride) {
  HWY_DYNAMIC_DISPATCH(TransposeRows8)(rows, left, out, stride);
}

void transpose_rows(std::span<const std::uint16_t* const> rows, int left, std::uint16_t* out, std::size_t stride) {
  HWY_DYNAMIC_DISPATCH(TransposeRows16)(rows, left, out, stride);
}

float take_off(const std::uint8_t* gray, std::size_t count, float black, float* light) {
  return HWY_DYNAMIC_DISPATCH(TakeOff8)(gray, count, black, light);
}

float take_off(const std::uint16_t* gray, std::size_t count, float black, float* light) {
  return HWY_DYNAMIC_DISPATCH(TakeOff16)(gray, count, black, light);
}

}  // namespace pagesweep
#endif
