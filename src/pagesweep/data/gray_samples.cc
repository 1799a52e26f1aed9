// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/data/gray_samples_internal.h"

#include <cstddef>
#include <limits>

// Not worth their time to compile beside SSE4, AVX2 and AVX-512.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pagesweep/data/gray_samples.cc"
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace pagesweep::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

template <class T>
bool ToSamples(const T* in, const GrayScale& scale, std::span<float> out) {
  const hn::ScalableTag<float> d;
  const hn::Rebind<std::int32_t, decltype(d)> integers;
  const hn::Rebind<T, decltype(d)> raw;
  constexpr float infinity = std::numeric_limits<float>::infinity();
  const auto black = hn::Set(d, scale.black), limit = hn::Set(d, scale.clipped), factor = hn::Set(d, scale.factor);
  auto highest = hn::Zero(d);
  std::size_t k = 0;
  for (; k + hn::Lanes(d) <= out.size(); k += hn::Lanes(d)) {
    const auto gray = hn::ConvertTo(d, hn::PromoteTo(integers, hn::LoadU(raw, in + k)));
    const auto clipped = hn::Ge(gray, limit);
    highest = hn::Max(highest, gray);
    hn::StoreU(hn::IfThenElse(clipped, hn::Set(d, infinity), hn::Mul(factor, hn::Sub(gray, black))), d, &out[k]);
  }
  bool rest = false;
  for (; k < out.size(); ++k) {
    const auto gray = static_cast<float>(in[k]);
    rest |= gray >= scale.clipped;
    out[k] = gray >= scale.clipped ? infinity : scale.factor * (gray - scale.black);
  }
  return rest || hn::GetLane(hn::MaxOfLanes(d, highest)) >= scale.clipped;
}

bool ToSamples8(const std::uint8_t* in, const GrayScale& scale, std::span<float> out) {
  return ToSamples(in, scale, out);
}
bool ToSamples16(const std::uint16_t* in, const GrayScale& scale, std::span<float> out) {
  return ToSamples(in, scale, out);
}

}  // namespace pagesweep::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pagesweep {

HWY_EXPORT(ToSamples8);
HWY_EXPORT(ToSamples16);

bool to_samples(const std::uint8_t* in, const GrayScale& scale, std::span<float> out) {
  return HWY_DYNAMIC_DISPATCH(ToSamples8)(in, scale, out);
}

bool to_samples(const std::uint16_t* in, const GrayScale& scale, std::span<float> out) {
  return HWY_DYNAMIC_DISPATCH(ToSamples16)(in, scale, out);
}

}  // namespace pagesweep
#endif
