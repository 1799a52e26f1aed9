// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/search_kernels_internal.h"

#include <algorithm>
#include <cstddef>

// Not worth their time to compile beside SSE4, AVX2 and AVX-512.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pagesweep/timing/search_kernels.cc"
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace pagesweep::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

void AddWeighted(std::span<const float> before, std::span<const float> frame, float weight, float ceiling,
                 std::span<float> sums) {
  const hn::ScalableTag<float> d;
  const auto w = hn::Set(d, weight), limit = hn::Set(d, ceiling);
  std::size_t x = 0;
  for (; x + hn::Lanes(d) <= frame.size(); x += hn::Lanes(d))
    hn::StoreU(hn::MulAdd(w, hn::Min(hn::LoadU(d, &frame[x]), limit), hn::LoadU(d, &before[x])), d, &sums[x]);
  for (; x < frame.size(); ++x) sums[x] = before[x] + weight * std::min(frame[x], ceiling);
}

void KeepHighest(const MeanOfFrames& middle, const MeanOfFrames& left, const MeanOfFrames& right, std::int32_t index,
                 std::span<float> rise, std::span<std::int32_t> frame) {
  const hn::ScalableTag<float> d;
  const hn::RebindToSigned<decltype(d)> integers;
  const auto mean = [&](const MeanOfFrames& box, std::size_t x) {
    return hn::Mul(hn::Set(d, box.factor), hn::Sub(hn::LoadU(d, box.end + x), hn::LoadU(d, box.begin + x)));
  };
  std::size_t x = 0;
  for (; x + hn::Lanes(d) <= rise.size(); x += hn::Lanes(d)) {
    const auto response = hn::Sub(mean(middle, x), hn::Add(mean(left, x), mean(right, x)));
    const auto before = hn::LoadU(d, &rise[x]);
    const auto higher = hn::Gt(response, before);
    hn::StoreU(hn::IfThenElse(higher, response, before), d, &rise[x]);
    const auto frames = hn::LoadU(integers, &frame[x]);
    hn::StoreU(hn::IfThenElse(hn::RebindMask(integers, higher), hn::Set(integers, index), frames), integers, &frame[x]);
  }
  for (; x < rise.size(); ++x) {
    const float response = middle.of(x) - left.of(x) - right.of(x);
    if (!(response > rise[x])) continue;
    rise[x] = response;
    frame[x] = index;
  }
}

}  // namespace pagesweep::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pagesweep {

HWY_EXPORT(AddWeighted);
HWY_EXPORT(KeepHighest);

void add_weighted(std::span<const float> before, std::span<const float> frame, float weight, float ceiling,
                  std::span<float> sums) {
  HWY_DYNAMIC_DISPATCH(AddWeighted)(before, frame, weight, ceiling, sums);
}

void keep_highest(const MeanOfFrames& middle, const MeanOfFrames& left, const MeanOfFrames& right, std::int32_t index,
                  std::span<float> rise, std::span<std::int32_t> frame) {
  HWY_DYNAMIC_DISPATCH(KeepHighest)(middle, left, right, index, rise, frame);
}

}  // namespace pagesweep
#endif
