// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/dewarping/resample_run_internal.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <type_traits>

// clang-format off
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pagesweep/dewarping/resample_run.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace pagesweep::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// ---- the place: plain loops, which the compiler makes vectors of

/// |row[i] - row[i - 1]| for i = x ... x + count; NaN where a neighbour is missing.
void differences_along(std::span<const float> row, int x, int count, float* out) {
  const float* at = row.data() + x;
  const int width = static_cast<int>(row.size());
  for (int k = x == 0; k < std::min(count + 1, width - x); ++k) out[k] = std::abs(at[k] - at[k - 1]);
  if (x == 0) out[0] = not_a_number;
  if (x + count == width) out[count] = not_a_number;
}

float smaller(float a, float b) { return b < a || a != a ? b : a; }
float square_or_0(float a) { return a != a ? 0 : a * a; }

/// Positions along one axis of the scan, and the kernel's width there.
void look_up_axis(const Image<float>& map, int x, int y, int count, int scan_size, std::int32_t* position,
                  std::int32_t* width) {
  float along[Lookups::most + 1];
  differences_along(map.row(y), x, count, along);
  // In the first and the last row one neighbour stands for both.
  const int y_above = y > 0 ? y - 1 : std::min(1, map.height() - 1);
  const int y_below = y + 1 < map.height() ? y + 1 : y_above;
  const float* at = map.row(y).data() + x;
  const float* above = map.row(y_above).data() + x;
  const float* below = map.row(y_below).data() + x;
  const float end = static_cast<float>(scan_size) - 0.5f;
  for (int k = 0; k < count; ++k) {
    const float across = smaller(along[k], along[k + 1]);
    const float down = smaller(std::abs(at[k] - above[k]), std::abs(below[k] - at[k]));
    const float scale = std::sqrt(square_or_0(across) + square_or_0(down));
    const float limited = scale > 1 ? (scale < largest_width ? scale : largest_width) : 1;
    const bool seen = (at[k] >= -0.5f) & (at[k] <= end);  // NaN is not
    width[k] = seen ? static_cast<std::int32_t>((limited - 1) * widths_per_unit + 0.5f) : Lookups::hidden;
    // Conversion cuts off, which rounds down what is positive: hence a pixel is added for the time being.
    constexpr float px = phases_per_px;
    position[k] = static_cast<std::int32_t>((seen ? at[k] : 0.0f) * px + (px + 0.5f)) - phases_per_px;
  }
}

void LookUp(const ScanMap& map, int x, int y, int count, int scan_width, int scan_height, Lookups& out) {
  out.count = count;
  look_up_axis(map.u, x, y, count, scan_width, out.u, out.width_u);
  look_up_axis(map.v, x, y, count, scan_height, out.v, out.width_v);
  for (int k = 0; k < count; ++k) {
    const bool hidden = (out.width_u[k] == Lookups::hidden) | (out.width_v[k] == Lookups::hidden);
    out.width_u[k] = hidden ? Lookups::hidden : out.width_u[k];
    out.width_v[k] = hidden ? Lookups::hidden : out.width_v[k];
  }
}

// ---- the sum: samples of one row and all channels are neighbours, and so they stand in a vector

/// Lanes of the sums. A gray pixel's few taps would leave a long vector empty.
template <class Weight, int Channels>
using SumTag = std::conditional_t<Channels == 1, hn::CappedTag<Weight, 8>, hn::ScalableTag<Weight>>;

/// Rounding depends on the order of a sum. Gray pixels are added up in the order of those in colour, so that a gray
/// picture comes out the same whichever way it is stored. Sums in fixed point are exact.
template <class Weight>
LaneLayout layout_of(int channels) {
  const int gray_lanes = static_cast<int>(hn::Lanes(SumTag<Weight, 1>()));
  const int colour_lanes = static_cast<int>(hn::Lanes(SumTag<Weight, 3>()));
  // Without vectors there is one lane, and a pixel's channels come one after the other.
  const int colour_pixels = std::max(1, colour_lanes / 3);
  if (channels == 3) return {std::max(3, colour_lanes), 3, colour_pixels};
  return {gray_lanes, 1, std::is_same_v<Weight, float> ? std::min(gray_lanes, colour_pixels) : gray_lanes};
}

/// Fixed point: samples and sums have 6 binary places.
template <class D, hwy::EnableIf<std::is_same_v<hn::TFromD<D>, std::int16_t>>* = nullptr>
hn::Vec<D> load_samples(D d, const std::uint8_t* samples) {
  return hn::ShiftLeft<6>(hn::PromoteTo(d, hn::LoadU(hn::Rebind<std::uint8_t, D>(), samples)));
}
template <class D, class T, hwy::EnableIf<std::is_same_v<hn::TFromD<D>, float>>* = nullptr>
hn::Vec<D> load_samples(D d, const T* samples) {
  const hn::RebindToSigned<D> whole;
  return hn::ConvertTo(d, hn::PromoteTo(whole, hn::LoadU(hn::Rebind<T, D>(), samples)));
}

template <class D, class V, hwy::EnableIf<std::is_same_v<hn::TFromD<D>, std::int16_t>>* = nullptr>
V add_weighted(D, V sum, V value, V weight) {
  return hn::Add(sum, hn::MulFixedPoint15(value, weight));
}
template <class D, class V, hwy::EnableIf<std::is_same_v<hn::TFromD<D>, float>>* = nullptr>
V add_weighted(D, V sum, V value, V weight) {
  return hn::MulAdd(value, weight, sum);
}

/// Sums over all rows and, lane by lane, over chunks of columns. \return  as many as the layout has lanes
template <class D, class T, class Weight>
HWY_INLINE void sum_pixel(D d, const ResampleRun<T, Weight>& run, const LaneLayout& layout, int k, Weight* sums) {
  const int taps_v = run.down->taps();
  const int x = (run.u[k] >> phase_bits) + first_tap(run.across->taps());
  const int y = (run.v[k] >> phase_bits) + first_tap(taps_v);
  const T* corner = run.scan + y * run.stride + static_cast<std::ptrdiff_t>(x) * run.channels;
  const Weight* down = run.down->down(run.v[k] & (phases_per_px - 1));
  const Weight* across = run.across->across(run.u[k] & (phases_per_px - 1));
  for (int lane = 0; lane < layout.lanes; lane += static_cast<int>(hn::Lanes(d))) {
    auto sum = hn::Zero(d);
    for (int chunk = 0; chunk < run.across->chunks(); ++chunk) {
      const T* row = corner + chunk * layout.used() + lane;
      auto column = hn::Zero(d);
      for (int j = 0; j < taps_v; ++j, row += run.stride)
        column = add_weighted(d, column, load_samples(d, row), hn::Set(d, down[j]));
      sum = add_weighted(d, sum, column, hn::Load(d, across + chunk * layout.lanes + lane));
    }
    hn::Store(sum, d, sums + lane);
  }
}

/// Adds up the lanes of each channel. Going through memory costs least.
template <int Channels, class Weight>
void add_lanes(const Weight* lanes, int pixels, Weight* sums) {
  const hn::CappedTag<Weight, 4> d;
  for (int c = 0; c < Channels; c += static_cast<int>(hn::Lanes(d))) {
    auto sum = hn::LoadU(d, lanes + c);
    for (int i = 1; i < pixels; ++i) sum = hn::Add(sum, hn::LoadU(d, lanes + c + i * Channels));
    hn::StoreU(sum, d, sums + c);
  }
}

#if HWY_TARGET != HWY_SCALAR
/// The same for gray pixels of eight lanes, eight pixels at a time, so that no vector is left with a single sum. In
/// fixed point the order of a sum does not matter.
void add_eight_lanes(const std::int16_t* lanes, int count, std::int16_t* sums) {
  const hn::Full128<std::int16_t> d;
  const hn::Full128<std::int32_t> pairs;
  const hn::Full128<std::int64_t> fours;
  // Of vectors that hold several pixels' sums side by side, each in as many parts: twice the pixels, half the parts.
  const auto merge = [&](auto as, auto a, auto b) {
    const auto x = hn::BitCast(as, a), y = hn::BitCast(as, b);
    return hn::Add(hn::BitCast(d, hn::InterleaveLower(as, x, y)), hn::BitCast(d, hn::InterleaveUpper(as, x, y)));
  };
  for (int k = 0; k < count; k += 8) {
    const auto pixel = [&](int i) { return hn::LoadU(d, lanes + 8 * (k + i)); };
    const auto two = [&](int i) { return merge(d, pixel(i), pixel(i + 1)); };
    const auto four = [&](int i) { return merge(pairs, two(i), two(i + 2)); };
    hn::StoreU(merge(fours, four(0), four(4)), d, sums + k);
  }
}
#endif

template <int Channels, class Weight>
void add_all_lanes(const Weight* lanes, const LaneLayout& layout, int pixels, int count, Weight* sums) {
#if HWY_TARGET != HWY_SCALAR
  if constexpr (Channels == 1 && std::is_same_v<Weight, std::int16_t>) return add_eight_lanes(lanes, count, sums);
#endif
  for (int k = 0; k < count; ++k) add_lanes<Channels>(lanes + k * layout.lanes, pixels, sums + k * Channels);
}

/// Sums to samples, rounded and clipped. Reads and writes whole vectors.
template <class T>
void store_samples(const float* sums, int count, T* out) {
  const hn::ScalableTag<float> d;
  const hn::RebindToSigned<decltype(d)> whole;
  const hn::Rebind<T, decltype(d)> narrow;
  const auto white = hn::Set(d, static_cast<float>(std::numeric_limits<T>::max()));
  for (int k = 0; k < count; k += static_cast<int>(hn::Lanes(d))) {
    const auto clipped = hn::Min(hn::Max(hn::LoadU(d, sums + k), hn::Zero(d)), white);
    const auto rounded = hn::ConvertTo(whole, hn::Add(clipped, hn::Set(d, 0.5f)));
    hn::StoreU(hn::DemoteTo(narrow, rounded), narrow, out + k);
  }
}
void store_samples(const std::int16_t* sums, int count, std::uint8_t* out) {
  const hn::ScalableTag<std::int16_t> d;
  const hn::Rebind<std::uint8_t, decltype(d)> narrow;
  for (int k = 0; k < count; k += static_cast<int>(hn::Lanes(d))) {
    const auto rounded = hn::ShiftRight<6>(hn::Add(hn::LoadU(d, sums + k), hn::Set(d, 32)));
    hn::StoreU(hn::DemoteTo(narrow, rounded), narrow, out + k);
  }
}

template <int Channels, class T, class Weight>
void sum_run(const ResampleRun<T, Weight>& run) {
  const SumTag<Weight, Channels> d;
  const LaneLayout layout = layout_of<Weight>(Channels);
  constexpr std::size_t slack = hn::MaxLanes(hn::ScalableTag<std::int16_t>()) + 4;  // written, but not meant
  alignas(64) Weight lanes[Lookups::most * std::max<std::size_t>(hn::MaxLanes(d), Channels) + slack];
  alignas(64) Weight sums[Lookups::most * Channels + slack];
  alignas(64) T samples[Lookups::most * Channels + slack];
  for (int k = 0; k < run.count; ++k) sum_pixel(d, run, layout, k, lanes + k * layout.lanes);
  const int pixels = std::min(run.across->taps(), layout.pixels);
  add_all_lanes<Channels>(lanes, layout, pixels, run.count, sums);
  store_samples(sums, run.count * Channels, samples);
  std::copy_n(samples, run.count * Channels, run.out);
}

template <class T, class Weight>
void sum_any(const ResampleRun<T, Weight>& run) {
  run.channels == 1 ? sum_run<1>(run) : sum_run<3>(run);
}

void RunBytes(const ResampleRun<std::uint8_t, std::int16_t>& run) { sum_any(run); }
void RunWideBytes(const ResampleRun<std::uint8_t, float>& run) { sum_any(run); }
void RunWords(const ResampleRun<std::uint16_t, float>& run) { sum_any(run); }

LaneLayout FixedPointLayout(int channels) { return layout_of<std::int16_t>(channels); }
LaneLayout FloatLayout(int channels) { return layout_of<float>(channels); }

}  // namespace
}  // namespace pagesweep::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pagesweep {

HWY_EXPORT(LookUp);
HWY_EXPORT(RunBytes);
HWY_EXPORT(RunWideBytes);
HWY_EXPORT(RunWords);
HWY_EXPORT(FixedPointLayout);
HWY_EXPORT(FloatLayout);

void look_up(const ScanMap& map, int x, int y, int count, int scan_width, int scan_height, Lookups& out) {
  HWY_DYNAMIC_DISPATCH(LookUp)(map, x, y, count, scan_width, scan_height, out);
}

void resample_run(const ResampleRun<std::uint8_t, std::int16_t>& run) { HWY_DYNAMIC_DISPATCH(RunBytes)(run); }
void resample_run(const ResampleRun<std::uint8_t, float>& run) { HWY_DYNAMIC_DISPATCH(RunWideBytes)(run); }
void resample_run(const ResampleRun<std::uint16_t, float>& run) { HWY_DYNAMIC_DISPATCH(RunWords)(run); }

LaneLayout fixed_point_layout(int channels) { return HWY_DYNAMIC_DISPATCH(FixedPointLayout)(channels); }
LaneLayout float_layout(int channels) { return HWY_DYNAMIC_DISPATCH(FloatLayout)(channels); }

}  // namespace pagesweep
#endif  // HWY_ONCE
