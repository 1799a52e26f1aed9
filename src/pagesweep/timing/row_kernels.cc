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
void CountClipped(Rows<T> rows, T saturation, std::span<std::uint8_t> counts) {
  const hn::ScalableTag<T> d;
  const auto lanes = hn::Lanes(d);
  const auto limit = hn::Set(d, saturation), one = hn::Set(d, T{1});
  HWY_ALIGN T clipped[hn::MaxLanes(d)];
  std::size_t x = 0;
  const auto add = [&](std::size_t at, unsigned many) {
    counts[at] = static_cast<std::uint8_t>(std::min(255U, counts[at] + many));
  };
  for (; x + lanes <= counts.size(); x += lanes) {
    auto count = hn::Zero(d);
    for (const T* row : rows) {
      // Unsigned a >= b where the larger of the two is a.
      const auto gray = hn::LoadU(d, row + x);
      count = hn::SaturatedAdd(count, hn::IfThenElseZero(hn::Eq(hn::Max(gray, limit), gray), one));
    }
    if (hn::AllTrue(d, hn::Eq(count, hn::Zero(d)))) continue;
    hn::Store(count, d, clipped);
    for (std::size_t k = 0; k < lanes; ++k) add(x + k, clipped[k]);
  }
  for (; x < counts.size(); ++x)
    for (const T* row : rows) add(x, row[x] >= saturation);
}

void KeepHighest(const BlockRows& rows, std::int32_t place, const HighestRow& highest, std::size_t count) {
  const Floats d;
  const hn::RebindToSigned<Floats> integers;
  const auto& [middle, side] = rows;
  std::size_t x = 0;
  for (; x + hn::Lanes(d) <= count; x += hn::Lanes(d)) {
    const auto at = [x](const float* row) { return hn::LoadU(Floats(), row + x); };
    const Vector sides = hn::Add(hn::Add(at(side[0]), at(side[1])), hn::Add(at(side[2]), at(side[3])));
    const Vector light = hn::Add(at(middle[0]), at(middle[1])), response = hn::Sub(hn::Add(light, light), sides);
    const Vector rise = at(highest.rise), last = at(highest.last);
    const auto bests = hn::LoadU(integers, highest.best + x);
    const auto higher = hn::Gt(response, rise);
    const auto follows = hn::RebindMask(d, hn::Eq(bests, hn::Set(integers, place - 1)));
    const Vector after = hn::IfThenElse(follows, response, at(highest.after));
    hn::StoreU(hn::IfThenElse(higher, response, rise), d, highest.rise + x);
    hn::StoreU(hn::IfThenElse(higher, last, at(highest.before)), d, highest.before + x);
    hn::StoreU(hn::IfThenElse(higher, hn::Set(d, std::numeric_limits<float>::quiet_NaN()), after), d,
               highest.after + x);
    hn::StoreU(response, d, highest.last + x);
    hn::StoreU(hn::IfThenElse(hn::RebindMask(integers, higher), hn::Set(integers, place), bests), integers,
               highest.best + x);
  }
  for (; x < count; ++x) {
    const float sides = (side[0][x] + side[1][x]) + (side[2][x] + side[3][x]), light = middle[0][x] + middle[1][x];
    const float response = light + light - sides;
    if (response > highest.rise[x]) {
      highest.rise[x] = response;
      highest.before[x] = highest.last[x];
      highest.after[x] = std::numeric_limits<float>::quiet_NaN();
      highest.best[x] = place;
    } else if (highest.best[x] == place - 1) {
      highest.after[x] = response;
    }
    highest.last[x] = response;
  }
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

void keep_highest(const BlockRows& rows, std::int32_t place, const HighestRow& highest, std::size_t count) {
  HWY_DYNAMIC_DISPATCH(KeepHighest)(rows, place, highest, count);
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
