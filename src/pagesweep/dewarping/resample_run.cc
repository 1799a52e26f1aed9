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

void find_bounds(const std::int32_t* position, int count, std::int32_t& low, std::int32_t& high) {
  std::int32_t least = position[0], most = position[0];
  for (int k = 1; k < count; ++k) {
    least = position[k] < least ? position[k] : least;
    most = position[k] > most ? position[k] : most;
  }
  low = least;
  high = most;
}

void LookUp(const ScanMap& map, int x, int y, int count, int scan_width, int scan_height, Lookups& out) {
  out.count = count;
  look_up_axis(map.u, x, y, count, scan_width, out.u, out.width_u);
  look_up_axis(map.v, x, y, count, scan_height, out.v, out.width_v);
  std::int32_t unlike = 0;
  for (int k = 0; k < count; ++k) {
    const bool hidden = (out.width_u[k] == Lookups::hidden) | (out.width_v[k] == Lookups::hidden);
    out.width_u[k] = hidden ? Lookups::hidden : out.width_u[k];
    out.width_v[k] = hidden ? Lookups::hidden : out.width_v[k];
    unlike |= (out.width_u[k] ^ out.width_u[0]) | (out.width_v[k] ^ out.width_v[0]);
  }
  out.alike = unlike == 0;
  find_bounds(out.u, count, out.low_u, out.high_u);
  find_bounds(out.v, count, out.low_v, out.high_v);
}

// ---- the sum: samples of one row and all channels are neighbours, and so they stand in a vector

/// Lanes of the sums. A gray pixel's few taps would leave a long vector empty.
template <class Weight, int Channels>
using SumTag = std::conditional_t<Channels == 1, hn::CappedTag<Weight, 8>, hn::ScalableTag<Weight>>;

/// Whether gray sums in float are taken over the same tap of neighbouring pixels, which needs vectors of known length.
#if HWY_TARGET != HWY_SCALAR && !HWY_HAVE_SCALABLE
constexpr bool sums_gray_by_taps = true;
#else
constexpr bool sums_gray_by_taps = false;
#endif

/// Rounding depends on the order of a sum. Gray pixels are added up in the order of those in colour, so that a gray
/// picture comes out the same whichever way it is stored. Sums in fixed point are exact.
template <class Weight>
LaneLayout layout_of(int channels) {
  const int gray_lanes = static_cast<int>(hn::Lanes(SumTag<Weight, 1>()));
  const int colour_lanes = static_cast<int>(hn::Lanes(SumTag<Weight, 3>()));
  // Without vectors there is one lane, and a pixel's channels come one after the other.
  const int colour_pixels = std::max(1, colour_lanes / 3);
  if (channels == 3) return {std::max(3, colour_lanes), 3, colour_pixels};
  const bool in_order_of_colour = std::is_same_v<Weight, float> && !sums_gray_by_taps;
  return {gray_lanes, 1, in_order_of_colour ? std::min(gray_lanes, colour_pixels) : gray_lanes};
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

/// Where pixels look in the scan, and their weights: what does not change from one pixel of a run to the next.
template <class T, class Weight>
struct Places {
  Places(const ResampleRun<T, Weight>& run, KernelRows<Weight> down_table)
      : stride(run.stride),
        channels(run.channels),
        scan(run.scan + first_tap(run.down->taps()) * stride +
             std::ptrdiff_t{first_tap(run.across->taps())} * channels),
        u(run.u),
        v(run.v),
        down(down_table),
        across(run.across->across()) {}

  const T* corner(int k) const {
    return scan + (v[k] >> phase_bits) * stride + std::ptrdiff_t{u[k] >> phase_bits} * channels;
  }
  const Weight* down_at(int k) const { return down[v[k] & (phases_per_px - 1)]; }
  const Weight* across_at(int k) const { return across[u[k] & (phases_per_px - 1)]; }

  const std::ptrdiff_t stride, channels;
  const T* const scan;
  const std::int32_t *const u, *const v;
  const KernelRows<Weight> down, across;
};

/// Sums over all rows and, lane by lane, over chunks of columns: as many as the layout has lanes, for each pixel.
/// \tparam taps_down  0: as many as the kernel has
template <int taps_down, class D, class T, class Weight>
void sum_lanes(D d, const ResampleRun<T, Weight>& run, const LaneLayout& layout, Weight* sums) {
  const Places places(run, run.down->down());
  const int taps_v = taps_down > 0 ? taps_down : run.down->taps();
  const int count = run.count, chunks = run.across->chunks(), lanes = layout.lanes, used = layout.used();
  for (int k = 0; k < count; ++k, sums += lanes)
    for (int lane = 0; lane < lanes; lane += static_cast<int>(hn::Lanes(d))) {
      const T* corner = places.corner(k) + lane;
      const Weight *down = places.down_at(k), *across = places.across_at(k) + lane;
      auto sum = hn::Zero(d);
      for (int chunk = 0; chunk < chunks; ++chunk) {
        const T* row = corner + chunk * used;
        auto column = hn::Zero(d);
        for (int j = 0; j < taps_v; ++j, row += places.stride)
          column = add_weighted(d, column, load_samples(d, row), hn::Set(d, down[j]));
        sum = add_weighted(d, sum, column, hn::Load(d, across + chunk * lanes));
      }
      hn::Store(sum, d, sums + lane);
    }
}

#if HWY_CAP_GE256 && !HWY_HAVE_SCALABLE
/// The same for gray pixels in fixed point: two rows of the scan in one vector.
/// \tparam taps_down  0: as many as the kernel has, an even number
template <int taps_down>
void sum_gray_lanes(const ResampleRun<std::uint8_t, std::int16_t>& run, std::int16_t* sums) {
  const hn::Full256<std::int16_t> two_rows;
  const hn::Full128<std::int16_t> d;
  const hn::Full128<std::uint8_t> bytes;
  const hn::Full64<std::uint8_t> row_bytes;
  constexpr int lanes = 8;
  const Places places(run, run.down->down_spread());
  const int count = run.count, chunks = run.across->chunks(), taps_v = taps_down > 0 ? taps_down : run.down->taps();
  for (int k = 0; k < count; ++k) {
    const std::uint8_t* corner = places.corner(k);
    const std::int16_t *down = places.down_at(k), *across = places.across_at(k);
    auto sum = hn::Zero(d);
    for (int chunk = 0; chunk < chunks; ++chunk) {
      const std::uint8_t* row = corner + chunk * lanes;
      auto columns = hn::Zero(two_rows);
      for (int j = 0; j < taps_v; j += 2, row += 2 * places.stride) {
        const auto samples = hn::Combine(bytes, hn::LoadU(row_bytes, row + places.stride), hn::LoadU(row_bytes, row));
        const auto values = hn::ShiftLeft<6>(hn::PromoteTo(two_rows, samples));
        columns = add_weighted(two_rows, columns, values, hn::LoadU(two_rows, down + j * lanes));
      }
      const auto column = hn::Add(hn::LowerHalf(d, columns), hn::UpperHalf(d, columns));
      sum = add_weighted(d, sum, column, hn::LoadU(d, across + chunk * lanes));
    }
    hn::StoreU(sum, d, sums + k * lanes);
  }
}
#endif

/// Calls use() with a kernel's taps as a constant, so that loops over them are unrolled, or with 0 if they are many.
template <class Use>
void unrolled(int taps, const Use& use) {
  if (taps == 4) return use(std::integral_constant<int, 4>());
  if (taps == 6) return use(std::integral_constant<int, 6>());
  use(std::integral_constant<int, 0>());
}

template <class D, class T, class Weight>
void sum_pixels(D d, const ResampleRun<T, Weight>& run, const LaneLayout& layout, Weight* sums) {
  unrolled(run.down->taps(), [&](auto taps) {
#if HWY_CAP_GE256 && !HWY_HAVE_SCALABLE
    if constexpr (std::is_same_v<Weight, std::int16_t>)
      if (run.channels == 1) return sum_gray_lanes<taps.value>(run, sums);
#endif
    sum_lanes<taps.value>(d, run, layout, sums);
  });
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

#if HWY_TARGET != HWY_SCALAR && !HWY_HAVE_SCALABLE
/// Columns of gray samples, or their weights, of as many pixels as a vector has lanes, in blocks of four taps.
template <class D>
struct TapBlocks {
  static constexpr int pixels = static_cast<int>(hn::MaxLanes(D()));
  static constexpr int most_taps = 2 * 3 * static_cast<int>(largest_width);
  alignas(64) float values[most_taps / 4 * pixels * 4];

  void store(hn::Vec<D> taps, int first_tap, int pixel) {
    const hn::Full128<float> four;
    float* out = values + first_tap * pixels + 4 * pixel;
    if constexpr (pixels == 4) {
      hn::Store(taps, four, out);
    } else {
      hn::Store(hn::LowerHalf(four, taps), four, out);
      hn::Store(hn::UpperHalf(four, taps), four, out + 4 * pixels);
    }
  }
};

/// Sums of gray pixels in float, as many as a vector has lanes. The order is that of colour, where every so-many-th tap
/// goes into the same partial sum.
/// \tparam taps  along both axes; 0: as many as the kernel has
template <int taps, class D, class T>
HWY_INLINE hn::Vec<D> sum_gray_vector(D d, const ResampleRun<T, float>& run, const Places<T, float>& places,
                                      int first) {
  constexpr int lanes = TapBlocks<D>::pixels;
  constexpr int parts = std::max(1, static_cast<int>(hn::MaxLanes(SumTag<float, 3>())) / 3);
  TapBlocks<D> columns, weights;
  const int taps_u = taps > 0 ? taps : run.across->taps(), taps_v = taps > 0 ? taps : run.down->taps();
  for (int pixel = 0; pixel < lanes; ++pixel) {
    const int k = std::min(first + pixel, run.count - 1);
    const T* corner = places.corner(k);
    const float *down = places.down_at(k), *across = places.across_at(k);
    for (int tap = 0; tap < taps_u; tap += lanes) {
      const T* row = corner + tap;
      auto column = hn::Zero(d);
      for (int j = 0; j < taps_v; ++j, row += places.stride)
        column = add_weighted(d, column, load_samples(d, row), hn::Set(d, down[j]));
      columns.store(column, tap, pixel);
      weights.store(hn::LoadU(d, across + tap), tap, pixel);
    }
  }
  hn::Vec<D> sums[parts];
  std::fill_n(sums, parts, hn::Zero(d));
  for (int tap = 0; tap < taps_u; tap += 4) {
    hn::Vec<D> c[4], w[4];
    hn::LoadInterleaved4(d, columns.values + tap * lanes, c[0], c[1], c[2], c[3]);
    hn::LoadInterleaved4(d, weights.values + tap * lanes, w[0], w[1], w[2], w[3]);
    for (int k = 0; k < std::min(4, taps_u - tap); ++k) {
      hn::Vec<D>& sum = sums[(tap + k) % parts];
      sum = hn::MulAdd(c[k], w[k], sum);
    }
  }
  for (int k = 1; k < std::min(parts, taps_u); ++k) sums[0] = hn::Add(sums[0], sums[k]);
  return sums[0];
}

template <int taps, class D, class T>
void sum_gray_vectors(D d, const ResampleRun<T, float>& run, float* sums) {
  const Places places(run, run.down->down());
  for (int k = 0; k < run.count; k += TapBlocks<D>::pixels)
    hn::StoreU(sum_gray_vector<taps>(d, run, places, k), d, sums + k);
}

/// Gray pixels in float.
template <class T>
void sum_gray_run(const ResampleRun<T, float>& run) {
  const SumTag<float, 1> d;
  constexpr std::size_t slack = hn::MaxLanes(hn::ScalableTag<float>());  // written, but not meant
  alignas(64) float sums[Lookups::most + slack];
  alignas(64) T samples[Lookups::most + slack];
  const int taps = run.down->taps() == run.across->taps() ? run.down->taps() : 0;
  unrolled(taps, [&](auto both) { sum_gray_vectors<both.value>(d, run, sums); });
  store_samples(sums, run.count, samples);
  std::copy_n(samples, run.count, run.out);
}
#endif

template <int Channels, class T, class Weight>
void sum_run(const ResampleRun<T, Weight>& run) {
  const SumTag<Weight, Channels> d;
  const LaneLayout layout = layout_of<Weight>(Channels);
  constexpr std::size_t slack = hn::MaxLanes(hn::ScalableTag<std::int16_t>()) + 4;  // written, but not meant
  alignas(64) Weight lanes[Lookups::most * std::max<std::size_t>(hn::MaxLanes(d), Channels) + slack];
  alignas(64) Weight sums[Lookups::most * Channels + slack];
  alignas(64) T samples[Lookups::most * Channels + slack];
  sum_pixels(d, run, layout, lanes);
  const int pixels = std::min(run.across->taps(), layout.pixels);
  add_all_lanes<Channels>(lanes, layout, pixels, run.count, sums);
  store_samples(sums, run.count * Channels, samples);
  std::copy_n(samples, run.count * Channels, run.out);
}

template <class T, class Weight>
void sum_any(const ResampleRun<T, Weight>& run) {
  if (run.channels == 3) return sum_run<3>(run);
#if HWY_TARGET != HWY_SCALAR && !HWY_HAVE_SCALABLE
  if constexpr (std::is_same_v<Weight, float>) return sum_gray_run(run);
#endif
  sum_run<1>(run);
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
