// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/outline_columns_internal.h"

// Not worth their time to compile beside SSE4, AVX2 and AVX-512.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pagesweep/timing/outline_columns.cc"
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace pagesweep::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Grays = hn::CappedTag<std::uint16_t, 32>;
using Vector = hn::Vec<Grays>;

/// Of vectors of samples, lane by lane, the one of which `rank` others are lower: bit by bit from the highest, a bit is
/// set if no more than that many are below what it makes.
Vector nth_of(const std::vector<std::uint16_t>& samples, std::size_t rank, std::uint16_t highest) {
  const Grays d;
  const Vector most = hn::Set(d, static_cast<std::uint16_t>(rank));
  Vector found = hn::Zero(d);
  unsigned bit = 1;
  while (2 * bit <= highest) bit *= 2;
  for (; bit > 0; bit /= 2) {
    const Vector candidate = hn::Or(found, hn::Set(d, static_cast<std::uint16_t>(bit)));
    Vector below = hn::Zero(d);
    for (std::size_t k = 0; k < samples.size(); k += hn::Lanes(d))
      below = hn::Sub(below, hn::VecFromMask(d, hn::Lt(hn::LoadU(d, &samples[k]), candidate)));
    found = hn::IfThenElse(hn::Gt(below, most), found, candidate);
  }
  return found;
}

void OutlineColumns(std::span<const std::uint16_t* const> rows, ColumnOutlines& out) {
  const Grays d;
  const std::size_t lanes = hn::Lanes(d), width = out.high.size();
  std::vector<std::uint16_t> samples(rows.size() * lanes), changes((rows.size() - 1) * lanes);
  for (std::size_t x = 0; x < width; x += lanes) {
    Vector high = hn::Zero(d), peak = hn::Zero(d), before = hn::LoadU(d, rows[0] + x);
    for (std::size_t k = 0; k < rows.size(); ++k) {
      const Vector gray = hn::LoadU(d, rows[k] + x);
      const auto higher = hn::Gt(gray, high);
      peak = hn::IfThenElse(higher, hn::Set(d, static_cast<std::uint16_t>(k)), peak);
      high = hn::IfThenElse(higher, gray, high);
      hn::StoreU(gray, d, &samples[k * lanes]);
      if (k > 0) hn::StoreU(hn::Sub(hn::Max(gray, before), hn::Min(gray, before)), d, &changes[(k - 1) * lanes]);
      before = gray;
    }
    hn::StoreU(high, d, &out.high[x]);
    hn::StoreU(peak, d, &out.peak[x]);
    const std::uint16_t highest = hn::GetLane(hn::MaxOfLanes(d, high));
    hn::StoreU(nth_of(samples, background_rank(rows.size()), highest), d, &out.background[x]);
    hn::StoreU(nth_of(changes, (rows.size() - 1) / 2, highest), d, &out.change[x]);
  }
}

}  // namespace pagesweep::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pagesweep {

HWY_EXPORT(OutlineColumns);

ColumnOutlines outline_columns(std::span<const std::uint16_t* const> rows, int columns) {
  const auto width = static_cast<std::size_t>(outlined_width(columns));
  ColumnOutlines outlines;
  for (auto* values : {&outlines.background, &outlines.change, &outlines.high, &outlines.peak}) values->resize(width);
  HWY_DYNAMIC_DISPATCH(OutlineColumns)(rows, outlines);
  return outlines;
}

}  // namespace pagesweep
#endif
