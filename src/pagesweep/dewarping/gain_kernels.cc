// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/dewarping/gain_kernels.h"

#include <algorithm>
#include <array>
#include <cmath>

// clang-format off
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pagesweep/dewarping/gain_kernels.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace pagesweep::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;
using Tag = hn::CappedTag<float, gain_row_step>;
using Vec = hn::Vec<Tag>;

template <std::size_t channels>
void SpreadRow(std::span<const std::vector<float>> nodes, float nodes_per_px, std::span<const float> shown,
               float* gains) {
  const Tag d;
  const hn::RebindToSigned<Tag> di;
  const auto last_node = static_cast<std::int32_t>(nodes[0].size()) - 2;
  const auto last = hn::Set(di, last_node);
  // Where a vector of pixels lies between as many nodes, these are loaded as a vector, too.
  const auto lanes = static_cast<int>(hn::Lanes(d));
  const bool are_near = nodes_per_px * static_cast<float>(lanes) <= static_cast<float>(lanes - 1);
  for (std::size_t x = 0; x < shown.size(); x += hn::Lanes(d)) {
    const Vec u = hn::Mul(hn::Iota(d, static_cast<float>(x) + 0.5f), hn::Set(d, nodes_per_px));
    const auto i = hn::Min(hn::ConvertTo(di, u), last);
    const Vec a = hn::Sub(u, hn::ConvertTo(d, i));
    const auto hidden = hn::IsNaN(hn::LoadU(d, &shown[x]));
    const int first = hn::GetLane(i);
    const bool by_lanes = are_near && first + lanes <= last_node + 1;
    const auto lane = hn::IndicesFromVec(d, by_lanes ? hn::Sub(i, hn::Set(di, first)) : hn::Zero(di));
    std::array<Vec, channels> gain;
    for (std::size_t c = 0; c < channels; ++c) {
      const float* node = nodes[c].data();
      const Vec left = by_lanes ? hn::TableLookupLanes(hn::LoadU(d, node + first), lane) : hn::GatherIndex(d, node, i);
      const Vec right =
          by_lanes ? hn::TableLookupLanes(hn::LoadU(d, node + first + 1), lane) : hn::GatherIndex(d, node + 1, i);
      gain[c] = hn::IfThenElse(hidden, hn::Set(d, left_alone), hn::MulAdd(a, hn::Sub(right, left), left));
    }
    if constexpr (channels == 3)
      hn::StoreInterleaved3(gain[0], gain[1], gain[2], d, gains + 3 * x);
    else
      hn::StoreU(gain[0], d, gains + x);
  }
}

void SpreadGains(std::span<const std::vector<float>> nodes, float nodes_per_px, std::span<const float> shown,
                 std::span<float> gains) {
  nodes.size() == 3 ? SpreadRow<3>(nodes, nodes_per_px, shown, gains.data())
                    : SpreadRow<1>(nodes, nodes_per_px, shown, gains.data());
}

void MultiplyLight(const ToneTables& tones, std::span<const float> gains, std::span<std::uint16_t> samples) {
  const Tag d;
  const hn::RebindToSigned<Tag> di;
  const hn::Rebind<std::uint16_t, Tag> dt;
  const Vec cells = hn::Set(d, ToneTables::cells);
  const auto last = hn::Set(di, ToneTables::cells - 1);
  for (std::size_t k = 0; k < samples.size(); k += hn::Lanes(d)) {
    const auto before = hn::PromoteTo(di, hn::LoadU(dt, &samples[k]));
    const Vec gain = hn::LoadU(d, &gains[k]);
    const Vec light = hn::Mul(hn::GatherIndex(d, tones.light.data(), before), gain);
    const Vec root = hn::Sqrt(hn::Min(hn::Max(light, hn::Zero(d)), hn::Set(d, 1)));
    const Vec place = hn::Mul(root, cells);
    const auto cell = hn::Min(hn::ConvertTo(di, place), last);
    const Vec low = hn::GatherIndex(d, tones.samples.data(), cell);
    const Vec high = hn::GatherIndex(d, tones.samples.data() + 1, cell);
    const Vec sample = hn::MulAdd(hn::Sub(place, hn::ConvertTo(d, cell)), hn::Sub(high, low), low);
    const auto after = hn::ConvertTo(di, hn::Add(sample, hn::Set(d, 0.5f)));
    const auto alone = hn::RebindMask(di, hn::Lt(gain, hn::Zero(d)));
    hn::StoreU(hn::DemoteTo(dt, hn::IfThenElse(alone, before, after)), dt, &samples[k]);
  }
}

}  // namespace
}  // namespace pagesweep::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pagesweep {

HWY_EXPORT(SpreadGains);
HWY_EXPORT(MultiplyLight);

ToneTables::ToneTables(const TransferCurve& curve, int bit_depth) : light(curve.table(bit_depth)) {
  const int white = (1 << bit_depth) - 1;
  for (int k = 0; k <= cells; ++k)
    samples.push_back(static_cast<float>(curve.sample(std::pow(double(k) / cells, 2)) * white));
}

void spread_gains(std::span<const std::vector<float>> nodes, float nodes_per_px, std::span<const float> shown,
                  std::span<float> gains) {
  HWY_DYNAMIC_DISPATCH(SpreadGains)(nodes, nodes_per_px, shown, gains);
}

void multiply_light(const ToneTables& tones, std::span<const float> gains, std::span<std::uint16_t> samples) {
  HWY_DYNAMIC_DISPATCH(MultiplyLight)(tones, gains, samples);
}

ByteTones::ByteTones(const ToneTables& tones, float least_gain, float most_gain)
    : first_(least_gain), steps_per_gain_(4096 / least_gain) {
  const int steps = static_cast<int>((most_gain - least_gain) * steps_per_gain_ + 0.5f) + 1;
  shown_ = Image<std::uint8_t>(1 + steps, 256);
  for (int s = 0; s < 256; ++s) {
    shown_(0, s) = static_cast<std::uint8_t>(s);
    for (int step = 0; step < steps; ++step) {
      const float gain = first_ + static_cast<float>(step) / steps_per_gain_;
      const float light = std::min(tones.light[static_cast<std::size_t>(s)] * gain, 1.0f);
      const auto cell = static_cast<std::size_t>(std::sqrt(light) * ToneTables::cells + 0.5f);
      shown_(1 + step, s) = static_cast<std::uint8_t>(tones.samples[cell] + 0.5f);
    }
  }
}

void ByteTones::multiply_light(std::span<const float> gains, std::span<std::uint8_t> samples) const {
  const float steps_per_gain = steps_per_gain_, offset = 1.5f - first_ * steps_per_gain_;
  const int columns = shown_.width(), last = columns - 1;
  const std::uint8_t* shown = shown_.data();
  constexpr std::size_t block = 64;
  for (std::size_t k = 0; k < samples.size(); k += block) {
    const std::size_t count = std::min(block, samples.size() - k);
    std::array<int, block> steps;
    for (std::size_t i = 0; i < count; ++i) {
      const int step = static_cast<int>(gains[k + i] * steps_per_gain + offset);
      steps[i] = step < 0 ? 0 : step > last ? last : step;
    }
    for (std::size_t i = 0; i < count; ++i) samples[k + i] = shown[samples[k + i] * columns + steps[i]];
  }
}

}  // namespace pagesweep
#endif
