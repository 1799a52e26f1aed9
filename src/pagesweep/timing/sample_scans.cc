// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/sample_scans_internal.h"

#include <limits>

// Not worth their time to compile beside SSE4, AVX2 and AVX-512.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pagesweep/timing/sample_scans.cc"
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace pagesweep::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Floats = hn::CappedTag<float, 16>;
using Vector = hn::Vec<Floats>;
using Mask = hn::Mask<Floats>;

/// Calls body(k, samples there and not clipped, samples there and clipped, absent ones) for whole vectors of samples.
template <class Body>
HWY_INLINE void for_samples(const float* gray, const float* present, int count, const Body& body) {
  const Floats d;
  const auto lanes = static_cast<int>(hn::Lanes(d));
  for (int k = 0; k < count; k += lanes) {
    const Mask within = hn::Lt(hn::Iota(d, static_cast<float>(k)), hn::Set(d, static_cast<float>(count)));
    const Mask there = hn::And(within, hn::Gt(hn::LoadU(d, present + k), hn::Zero(d)));
    const Mask infinite = hn::IsInf(hn::LoadU(d, gray + k));
    body(k, hn::AndNot(infinite, there), hn::And(infinite, there), hn::AndNot(there, within));
  }
}

SampleScan ScanSamples(const float* gray, const float* present, int count) {
  const Floats d;
  Vector low = hn::Set(d, std::numeric_limits<float>::infinity()), high = hn::Zero(d);
  int seen = 0, clipped = 0;
  for_samples(gray, present, count, [&](int k, Mask is_seen, Mask is_clipped, Mask) {
    const Vector sample = hn::LoadU(d, gray + k);
    low = hn::IfThenElse(is_seen, hn::Min(low, sample), low);
    high = hn::IfThenElse(is_seen, hn::Max(high, sample), high);
    seen += static_cast<int>(hn::CountTrue(d, is_seen));
    clipped += static_cast<int>(hn::CountTrue(d, is_clipped));
  });
  return {hn::GetLane(hn::MinOfLanes(d, low)), hn::GetLane(hn::MaxOfLanes(d, high)), seen, clipped};
}

LostSlopes SumLostSlopes(const float* slope, const float* gray, const float* present, int count) {
  const Floats d;
  Vector absent[2] = {hn::Zero(d), hn::Zero(d)}, clipped[2] = {hn::Zero(d), hn::Zero(d)};
  for_samples(gray, present, count, [&](int k, Mask, Mask is_clipped, Mask is_absent) {
    const Vector here = hn::LoadU(d, slope + k), square = hn::Mul(here, here);
    const Mask rises = hn::Gt(here, hn::Zero(d));
    absent[0] = hn::Add(absent[0], hn::IfThenElseZero(hn::And(is_absent, rises), square));
    absent[1] = hn::Add(absent[1], hn::IfThenElseZero(hn::AndNot(rises, is_absent), square));
    clipped[0] = hn::Add(clipped[0], hn::IfThenElseZero(hn::And(is_clipped, rises), square));
    clipped[1] = hn::Add(clipped[1], hn::IfThenElseZero(hn::AndNot(rises, is_clipped), square));
  });
  const auto total = [d](Vector sum) { return hn::GetLane(hn::SumOfLanes(d, sum)); };
  return {{total(absent[0]), total(absent[1])}, {total(clipped[0]), total(clipped[1])}};
}

}  // namespace pagesweep::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pagesweep {

HWY_EXPORT(ScanSamples);
HWY_EXPORT(SumLostSlopes);

SampleScan scan_samples(const float* gray, const float* present, int count) {
  return HWY_DYNAMIC_DISPATCH(ScanSamples)(gray, present, count);
}

LostSlopes lost_slopes(const float* slope, const float* gray, const float* present, int count) {
  return HWY_DYNAMIC_DISPATCH(SumLostSlopes)(slope, gray, present, count);
}

}  // namespace pagesweep
#endif
