// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/row_kernels_internal.h"

#include <algorithm>
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

void KeepHighest(const BlockRows& rows, std::int32_t index, std::span<float> responses, std::span<float> rise,
                 std::span<std::int32_t> best) {
  const Floats d;
  const hn::RebindToSigned<Floats> integers;
  const auto& [middle, side] = rows;
  std::size_t x = 0;
  for (; x + hn::Lanes(d) <= rise.size(); x += hn::Lanes(d)) {
    const auto at = [x](const float* row) { return hn::LoadU(Floats(), row + x); };
    const Vector sides = hn::Add(hn::Add(at(side[0]), at(side[1])), hn::Add(at(side[2]), at(side[3])));
    const Vector light = hn::Add(at(middle[0]), at(middle[1])), response = hn::Sub(hn::Add(light, light), sides);
    const Vector before = at(rise.data());
    const auto higher = hn::Gt(response, before);
    hn::StoreU(response, d, &responses[x]);
    hn::StoreU(hn::IfThenElse(higher, response, before), d, &rise[x]);
    const auto bests = hn::LoadU(integers, &best[x]);
    hn::StoreU(hn::IfThenElse(hn::RebindMask(integers, higher), hn::Set(integers, index), bests), integers, &best[x]);
  }
  for (; x < rise.size(); ++x) {
    const float sides = (side[0][x] + side[1][x]) + (side[2][x] + side[3][x]), light = middle[0][x] + middle[1][x];
    responses[x] = light + light - sides;
    if (!(responses[x] > rise[x])) continue;
    rise[x] = responses[x];
    best[x] = index;
  }
}

/// As many vectors as they have lanes become the vectors of their first, second, ... lanes: each pass turns the
/// address, vector number before lane number, by one bit.
void transpose(Vector* vectors) {
#if HWY_TARGET != HWY_SCALAR
  const Floats d;
  const std::size_t lanes = hn::Lanes(d);
  for (std::size_t pass = 1; pass < lanes; pass *= 2) {
    Vector turned[tile_pixels];
    for (std::size_t k = 0; k < lanes / 2; ++k) {
      turned[k] = hn::ConcatEven(d, vectors[2 * k + 1], vectors[2 * k]);
      turned[k + lanes / 2] = hn::ConcatOdd(d, vectors[2 * k + 1], vectors[2 * k]);
    }
    std::copy_n(turned, lanes, vectors);
  }
#else
  (void)vectors;
#endif
}

template <class T>
void TransposeRows(Rows<T> rows, int left, float black, float* out, std::size_t stride, float* most) {
  const Floats d;
  const hn::Rebind<std::int32_t, Floats> integers;
  const hn::Rebind<T, Floats> raw;
  const std::size_t lanes = hn::Lanes(d);
  for (std::size_t first_pixel = 0; first_pixel < tile_pixels; first_pixel += lanes) {
    Vector highest = hn::Zero(d);
    for (std::size_t first = 0; first < rows.size(); first += lanes) {
      Vector vectors[tile_pixels];
      for (std::size_t i = 0; i < lanes; ++i) {
        if (first + i >= rows.size()) {
          vectors[i] = hn::Zero(d);
          continue;
        }
        const T* row = rows[first + i] + static_cast<std::size_t>(left) + first_pixel;
        const Vector gray = hn::ConvertTo(d, hn::PromoteTo(integers, hn::LoadU(raw, row)));
        highest = hn::Max(highest, gray);
        vectors[i] = hn::Sub(gray, hn::Set(d, black));
      }
      transpose(vectors);
      for (std::size_t p = 0; p < lanes; ++p) hn::StoreU(vectors[p], d, out + (first_pixel + p) * stride + first);
    }
    hn::StoreU(highest, d, most + first_pixel);
  }
}

void SumRows8(Rows<std::uint8_t> rows, int left, float factor, std::span<float> sums) {
  SumRows(rows, left, factor, sums);
}
void SumRows16(Rows<std::uint16_t> rows, int left, float factor, std::span<float> sums) {
  SumRows(rows, left, factor, sums);
}
void TransposeRows8(Rows<std::uint8_t> rows, int left, float black, float* out, std::size_t stride, float* most) {
  TransposeRows(rows, left, black, out, stride, most);
}
void TransposeRows16(Rows<std::uint16_t> rows, int left, float black, float* out, std::size_t stride, float* most) {
  TransposeRows(rows, left, black, out, stride, most);
}

}  // namespace pagesweep::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pagesweep {

HWY_EXPORT(SumRows8);
HWY_EXPORT(SumRows16);
HWY_EXPORT(KeepHighest);
HWY_EXPORT(TransposeRows8);
HWY_EXPORT(TransposeRows16);

void sum_rows(std::span<const std::uint8_t* const> rows, int left, float factor, std::span<float> sums) {
  HWY_DYNAMIC_DISPATCH(SumRows8)(rows, left, factor, sums);
}

void sum_rows(std::span<const std::uint16_t* const> rows, int left, float factor, std::span<float> sums) {
  HWY_DYNAMIC_DISPATCH(SumRows16)(rows, left, factor, sums);
}

void keep_highest(const BlockRows& rows, std::int32_t index, std::span<float> responses, std::span<float> rise,
                  std::span<std::int32_t> best) {
  HWY_DYNAMIC_DISPATCH(KeepHighest)(rows, index, responses, rise, best);
}

void transpose_rows(std::span<const std::uint8_t* const> rows, int left, float black, float* out, std::size_t stride,
                    float* most) {
  HWY_DYNAMIC_DISPATCH(TransposeRows8)(rows, left, black, out, stride, most);
}

void transpose_rows(std::span<const std::uint16_t* const> rows, int left, float black, float* out, std::size_t stride,
                    float* most) {
  HWY_DYNAMIC_DISPATCH(TransposeRows16)(rows, left, black, out, stride, most);
}

}  // namespace pagesweep
#endif
