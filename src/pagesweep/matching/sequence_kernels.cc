// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "pagesweep/matching/sequence_kernels_internal.h"

// Not worth their time to compile beside SSE4, AVX2 and AVX-512.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pagesweep/matching/sequence_kernels.cc"
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace pagesweep::HWY_NAMESPACE {
namespace {
namespace hn = hwy::HWY_NAMESPACE;

using Floats = hn::CappedTag<float, score_padding>;
using Integers = hn::RebindToSigned<Floats>;
/// Half of the longest vector: what the additions gain from more lanes, adding those up takes.
using Samples = hn::CappedTag<std::int16_t, sequence_padding / 2>;
using Sums = hn::RepartitionToWide<Samples>;
using FloatVector = hn::Vec<Floats>;
using IntegerVector = hn::Vec<Integers>;
using SampleVector = hn::Vec<Samples>;
using SumVector = hn::Vec<Sums>;
constexpr int samples_at_once = hn::MaxLanes(Samples());
constexpr int scores_at_once = hn::MaxLanes(Integers());
static_assert(score_padding % 4 == 0);

FloatVector set(float value) { return hn::Set(Floats(), value); }

/// Partial sums of scalar products.
HWY_INLINE SumVector add_product(SampleVector a, SampleVector b, SumVector sum) {
  SumVector more = hn::Zero(Sums());
  sum = hn::ReorderWidenMulAccumulate(Sums(), a, b, sum, more);
  return hn::Add(sum, more);
}

/// Adds up the lanes of four vectors.
#if HWY_TARGET == HWY_SCALAR
HWY_INLINE void store_totals(SumVector a, SumVector b, SumVector c, SumVector d, std::int32_t* out) {
  const SumVector totals[] = {a, b, c, d};
  for (int k = 0; k < 4; ++k) out[k] = hn::GetLane(totals[k]);
}
#else
using Block = hn::Full128<std::int32_t>;
HWY_INLINE hn::Vec<Block> add_blocks(hn::Vec<Block> v) { return v; }
template <class V>
HWY_INLINE hn::Vec<Block> add_blocks(V v) {
  const hn::Half<hn::DFromV<V> > half;
  return add_blocks(hn::Add(hn::LowerHalf(half, v), hn::UpperHalf(half, v)));
}

/// Within blocks of four lanes first, then block by block.
HWY_INLINE void store_totals(SumVector a, SumVector b, SumVector c, SumVector d, std::int32_t* out) {
  const Sums tag;
  const hn::Repartition<std::int64_t, Sums> pairs;
  const SumVector ab = hn::Add(hn::InterleaveLower(tag, a, b), hn::InterleaveUpper(tag, a, b));
  const SumVector cd = hn::Add(hn::InterleaveLower(tag, c, d), hn::InterleaveUpper(tag, c, d));
  const auto p = hn::BitCast(pairs, ab), q = hn::BitCast(pairs, cd);
  const SumVector totals =
      hn::Add(hn::BitCast(tag, hn::InterleaveLower(pairs, p, q)), hn::BitCast(tag, hn::InterleaveUpper(pairs, p, q)));
  hn::StoreU(add_blocks(totals), Block(), out);
}
#endif

constexpr int with_padding(int count) { return (count + score_padding - 1) / score_padding * score_padding; }

/// The pixels nearest to a curve's places.
void find_pixels(const SequenceArrays& to, const LensNumbers& lens, const CurveLine& line, std::int32_t* pixels) {
  const Integers integers;
  const FloatVector last_column = set(static_cast<float>(to.width - 1)),
                    last_row = set(static_cast<float>(to.height - 1));
  const FloatVector half = set(0.5f), zero = hn::Zero(Floats());
  const auto inside = [&](FloatVector p, FloatVector last) {
    return hn::And(hn::Ge(p, hn::Neg(half)), hn::Le(p, hn::Add(last, half)));
  };
  const auto nearest = [&](FloatVector p, FloatVector last) { return hn::NearestInt(hn::Min(hn::Max(p, zero), last)); };
  alignas(64) static constexpr float ahead[score_padding] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
  const FloatVector first = hn::Load(Floats(), ahead);
  for (int k = 0; k < with_padding(line.count); k += scores_at_once) {
    const FloatVector step = hn::Add(first, set(static_cast<float>(k)));
    const FloatVector x = hn::MulAdd(step, set(line.dx), set(line.x)), y = hn::MulAdd(step, set(line.dy), set(line.y));
    const FloatVector xx = hn::Mul(x, x), yy = hn::Mul(y, y), rr = hn::Add(xx, yy);
    const FloatVector xy2 = hn::Mul(set(2), hn::Mul(x, y));
    const FloatVector radial =
        hn::MulAdd(rr, hn::MulAdd(rr, hn::MulAdd(rr, set(lens.k3), set(lens.k2)), set(lens.k1)), set(1));
    const FloatVector tangent_x = hn::MulAdd(set(lens.p1), xy2, hn::Mul(set(lens.p2), hn::MulAdd(set(2), xx, rr)));
    const FloatVector tangent_y = hn::MulAdd(set(lens.p2), xy2, hn::Mul(set(lens.p1), hn::MulAdd(set(2), yy, rr)));
    const FloatVector u = hn::MulAdd(set(lens.fx), hn::MulAdd(x, radial, tangent_x), set(lens.cx));
    const FloatVector v = hn::MulAdd(set(lens.fy), hn::MulAdd(y, radial, tangent_y), set(lens.cy));
    const auto seen =
        hn::And(hn::And(inside(u, last_column), inside(v, last_row)),
                hn::And(hn::Le(rr, set(lens.max_radius_squared)), hn::Lt(step, set(static_cast<float>(line.count)))));
    const IntegerVector pixel =
        hn::Add(hn::Mul(nearest(v, last_row), hn::Set(integers, to.width)), nearest(u, last_column));
    hn::StoreU(hn::IfThenElse(hn::RebindMask(integers, seen), pixel, hn::Set(integers, to.nowhere())), integers,
               pixels + k);
  }
}

HWY_INLINE SumVector product(const std::int16_t* a, const std::int16_t* b, int length) {
  const Samples samples;
  SumVector sum = hn::Zero(Sums());
  for (int i = 0; i < length; i += sequence_padding)
    for (int k = 0; k < sequence_padding; k += samples_at_once)
      sum = add_product(hn::LoadU(samples, a + i + k), hn::LoadU(samples, b + i + k), sum);
  return sum;
}

/// Scalar products with the sequences of some pixels, a multiple of 4. \tparam IsShort  they have one part only
template <bool IsShort>
HWY_INLINE void multiply_all(const SequenceArrays& to, const std::int16_t* own, const std::int32_t* pixels, int count,
                             std::int32_t* products) {
  const int length = IsShort ? sequence_padding : to.length;
  const auto with = [&](int k) {
    return product(own, to.data + static_cast<std::ptrdiff_t>(pixels[k]) * length, length);
  };
  for (int k = 0; k < count; k += 4) store_totals(with(k), with(k + 1), with(k + 2), with(k + 3), products + k);
}

std::int32_t ScoreCurve(const SequenceArrays& to, const LensNumbers& lens, const CurveLine& line,
                        const std::int16_t* own, std::int32_t own_square, std::int32_t* pixels, std::int32_t* scores) {
  find_pixels(to, lens, line, pixels);
  const Integers integers;
  const int count = with_padding(line.count);
  if (to.length == sequence_padding) {
    multiply_all<true>(to, own, pixels, count, scores);
  } else {
    multiply_all<false>(to, own, pixels, count, scores);
  }
  IntegerVector least = hn::Set(integers, std::numeric_limits<std::int32_t>::max());
  for (int k = 0; k < count; k += scores_at_once) {
    const IntegerVector squares = to.squares ? hn::GatherIndex(integers, to.squares, hn::LoadU(integers, pixels + k))
                                             : hn::Set(integers, sequence_scale * sequence_scale);
    const IntegerVector twice = hn::ShiftLeft<1>(hn::LoadU(integers, scores + k));
    const IntegerVector score = hn::Sub(hn::Add(squares, hn::Set(integers, own_square)), twice);
    least = hn::Min(least, score);
    hn::StoreU(score, integers, scores + k);
  }
  return hn::GetLane(hn::MinOfLanes(integers, least));
}

/// How near a sequence g comes to the line from S_0 to S_1, all by their scalar products.
/// \return share of the way, and distance
std::pair<float, float> nearest_on_line(float gg, float g0, float g1, float s0, float s1, float s01, bool affine) {
  const float a = g0 * s1 - g1 * s01, b = g1 * s0 - g0 * s01, length_squared = s0 - 2 * s01 + s1;
  float share = 0;
  if (affine && a + b > 0) share = b / (a + b);
  if (!affine && length_squared > 0) share = (g1 - g0 + s0 - s01) / length_squared;
  share = std::clamp(share, 0.0f, 1.0f);
  const float gs = g0 + share * (g1 - g0), ss = s0 + share * (2 * (s01 - s0) + share * length_squared);
  const float distance_squared = affine ? (gs > 0 && ss > 0 ? gg - gs * gs / ss : gg) : gg - 2 * gs + ss;
  return {share, distance_squared};
}

/// A minimum of the scores, improved.
CurveMinimum improve(const ScoredCurve& curve, int k) {
  const SequenceArrays& to = *curve.to;
  const auto square = [&](std::int32_t pixel) {
    return static_cast<float>(to.squares ? to.squares[pixel] : sequence_scale * sequence_scale);
  };
  const int neighbour = curve.scores[k - 1] < curve.scores[k + 1] ? k - 1 : k + 1;
  CurveMinimum best{static_cast<float>(k), static_cast<float>(curve.scores[k])};
  if (neighbour < 0 || neighbour >= curve.count) return best;
  const std::int32_t here = curve.pixels[k], there = curve.pixels[neighbour];
  if (here == there || there == to.nowhere()) return best;
  const SumVector lanes = product(to.sequence(here), to.sequence(there), to.length);
  const auto gg = static_cast<float>(curve.own_square), s0 = square(here), s1 = square(there);
  const float g0 = 0.5f * (gg + s0 - static_cast<float>(curve.scores[k]));
  const float g1 = 0.5f * (gg + s1 - static_cast<float>(curve.scores[neighbour]));
  const auto s01 = static_cast<float>(hn::GetLane(hn::SumOfLanes(Sums(), lanes)));
  const auto [share, distance_squared] = nearest_on_line(gg, g0, g1, s0, s1, s01, curve.affine);
  return {static_cast<float>(k) + share * static_cast<float>(neighbour - k), distance_squared};
}

int FindMinima(const ScoredCurve& curve, std::int32_t limit, CurveMinimum* minima) {
  const Integers integers;
  int found = 0;
  for (int first = 0; first < curve.count; first += scores_at_once) {
    const std::int32_t* scores = curve.scores + first;
    const IntegerVector here = hn::LoadU(integers, scores);
    const IntegerVector before = hn::LoadU(integers, scores - 1), behind = hn::LoadU(integers, scores + 1);
    const auto too_large = hn::Or(hn::Gt(here, hn::Set(integers, limit)), hn::Gt(here, behind));
    const auto is_minimum = hn::AndNot(too_large, hn::Lt(here, before));
    if (hn::AllFalse(integers, is_minimum)) continue;
    std::uint8_t bytes[8] = {};
    hn::StoreMaskBits(integers, is_minimum, bytes);
    for (unsigned bits = bytes[0] | static_cast<unsigned>(bytes[1]) << 8; bits != 0; bits &= bits - 1) {
      const int place = first + std::countr_zero(bits);
      minima[found++] = {static_cast<float>(place), static_cast<float>(curve.scores[place])};
    }
  }
  return found;
}

void ImproveMinima(const ScoredCurve& curve, std::span<CurveMinimum> minima) {
  for (CurveMinimum& minimum : minima) minimum = improve(curve, static_cast<int>(minimum.place));
}

template <class D>
HWY_INLINE hn::Vec<D> between(D d, const Crossing& crossing, int i) {
  const auto low = hn::LoadU(d, crossing.low + i), high = hn::LoadU(d, crossing.high + i);
  return hn::Add(low, hn::MulFixedPoint15(hn::Sub(high, low), hn::Set(d, crossing.share)));
}

CrossingProducts Multiply(const Crossing* crossings, const std::int16_t* own, int length) {
  constexpr int count = CrossingProducts::crossings, sums = 1 + count + count * (count + 1) / 2;
  SumVector sum[sums + 1];
  HWY_UNROLL(16)
  for (int k = 0; k <= sums; ++k) sum[k] = hn::Zero(Sums());
  for (int i = 0; i < length; i += samples_at_once) {
    SampleVector s[1 + count] = {hn::LoadU(Samples(), own + i)};  // g, S_0, S_1, ...
    HWY_UNROLL(4)
    for (int k = 0; k < count; ++k) s[1 + k] = between(Samples(), crossings[k], i);
    int k = 0;
    HWY_UNROLL(5)
    for (int a = 0; a <= count; ++a) sum[k] = add_product(s[0], s[a], sum[k]), ++k;
    HWY_UNROLL(4)
    for (int a = 1; a <= count; ++a) HWY_UNROLL(4)
    for (int b = a; b <= count; ++b) sum[k] = add_product(s[a], s[b], sum[k]), ++k;
  }
  alignas(64) std::int32_t totals[sums + 1];
  HWY_UNROLL(4)
  for (int k = 0; k < sums; k += 4) store_totals(sum[k], sum[k + 1], sum[k + 2], sum[k + 3], totals + k);
  CrossingProducts products{totals[0], {totals[1], totals[2], totals[3], totals[4]}, {}};
  int k = 1 + count;
  for (int a = 0; a < count; ++a)
    for (int b = a; b < count; ++b) products.ss[a][b] = totals[k++];
  return products;
}

ResidualSums SumResiduals(const Mixture& mixture, const std::int16_t* own, int length) {
  const Floats floats;
  const hn::Rebind<std::int16_t, Floats> samples;
  const auto to_floats = [&](auto s) { return hn::ConvertTo(floats, hn::PromoteTo(Integers(), s)); };
  FloatVector rr = hn::Zero(floats), dd = rr, rrdd = rr;
  for (int i = 0; i < length; i += static_cast<int>(hn::Lanes(floats))) {
    const FloatVector g = to_floats(hn::LoadU(samples, own + i));
    FloatVector r = g, d = hn::Mul(g, set(mixture.change_of_own));
    HWY_UNROLL(4)
    for (int k = 0; k < 4; ++k) {
      const FloatVector s = to_floats(between(samples, mixture.crossings[k], i));
      r = hn::NegMulAdd(s, set(mixture.value[k]), r);
      d = hn::MulAdd(s, set(mixture.change[k]), d);
    }
    const FloatVector rd = hn::Mul(r, d);
    rr = hn::MulAdd(r, r, rr);
    dd = hn::MulAdd(d, d, dd);
    rrdd = hn::MulAdd(rd, rd, rrdd);
  }
  const auto total = [&](FloatVector v) { return hn::GetLane(hn::SumOfLanes(floats, v)); };
  return {total(rr), total(dd), total(rrdd)};
}

/// As many pixels of the rows as a vector has lanes.
class PixelColumn {
 public:
  PixelColumn(const GrayRows& gray, int first) : gray_(gray), first_(first) {}

  FloatVector at(std::size_t frame) const {
    const FloatVector gray = hn::LoadU(Floats(), gray_.frames[frame] + first_);
    return hn::Max(hn::Min(gray, set(gray_.range)), set(-gray_.range));
  }

  /// \return the mean
  FloatVector summarise(const SequenceStatistics& out, FloatVector& energy) const {
    FloatVector lowest = set(gray_.range), highest = hn::Neg(lowest), sum = hn::Zero(Floats());
    for (std::size_t i = 0; i < gray_.frames.size(); ++i) {
      const FloatVector g = at(i);
      lowest = hn::Min(lowest, g);
      highest = hn::Max(highest, g);
      sum = hn::Add(sum, g);
    }
    const FloatVector mean = hn::Mul(sum, set(1 / static_cast<float>(gray_.frames.size())));
    energy = hn::Zero(Floats());
    for (std::size_t i = 0; i < gray_.frames.size(); ++i) {
      const FloatVector deviation = hn::Sub(at(i), mean);
      energy = hn::MulAdd(deviation, deviation, energy);
    }
    hn::StoreU(lowest, Floats(), out.lowest + first_);
    hn::StoreU(highest, Floats(), out.highest + first_);
    hn::StoreU(energy, Floats(), out.energy + first_);
    return mean;
  }

  /// Two frames at a time, which are neighbours in each pixel's sequence.
  void pack(FloatVector offset, FloatVector scale, int length, std::int16_t* out) const {
    const auto sample = [&](std::size_t i) {
      return i < gray_.frames.size() ? hn::NearestInt(hn::Mul(hn::Sub(at(i), offset), scale)) : hn::Zero(Integers());
    };
    const int pixels = std::min(scores_at_once, gray_.pixels - first_);
    alignas(64) std::int32_t pairs[scores_at_once];
    for (int i = 0; i < length; i += 2) {
      const IntegerVector low = hn::And(sample(static_cast<std::size_t>(i)), hn::Set(Integers(), 0xffff));
      const IntegerVector high = hn::ShiftLeft<16>(sample(static_cast<std::size_t>(i) + 1));
      hn::Store(hn::Or(low, high), Integers(), pairs);
      for (int p = 0; p < pixels; ++p)
        std::memcpy(out + static_cast<std::ptrdiff_t>(first_ + p) * length + i, pairs + p, sizeof(pairs[0]));
    }
  }

 private:
  const GrayRows& gray_;
  int first_;
};

void PackSequences(const GrayRows& gray, bool affine, int length, std::int16_t* out,
                   const SequenceStatistics& statistics) {
  const FloatVector full_size = set(gray.range * std::sqrt(static_cast<float>(gray.frames.size())));
  for (int first = 0; first < gray.pixels; first += scores_at_once) {
    const PixelColumn column(gray, first);
    FloatVector energy;
    const FloatVector mean = column.summarise(statistics, energy);
    const FloatVector size = affine ? hn::Sqrt(hn::Max(energy, set(1e-6f))) : full_size;
    const FloatVector scale = hn::Div(set(sequence_scale), size);
    hn::StoreU(scale, Floats(), statistics.scale + first);
    column.pack(affine ? mean : hn::Zero(Floats()), scale, length, out);
  }
}

}  // namespace
}  // namespace pagesweep::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pagesweep {

HWY_EXPORT(PackSequences);
HWY_EXPORT(ScoreCurve);
HWY_EXPORT(FindMinima);
HWY_EXPORT(ImproveMinima);
HWY_EXPORT(Multiply);
HWY_EXPORT(SumResiduals);

void pack_sequences(const GrayRows& gray, bool affine, int length, std::int16_t* out,
                    const SequenceStatistics& statistics) {
  HWY_DYNAMIC_DISPATCH(PackSequences)(gray, affine, length, out, statistics);
}

std::int32_t score_curve(const SequenceArrays& to, const LensNumbers& lens, const CurveLine& line,
                         const std::int16_t* own, std::int32_t own_square, std::int32_t* pixels, std::int32_t* scores) {
  return HWY_DYNAMIC_DISPATCH(ScoreCurve)(to, lens, line, own, own_square, pixels, scores);
}

int find_minima(const ScoredCurve& curve, std::int32_t limit, CurveMinimum* minima) {
  return HWY_DYNAMIC_DISPATCH(FindMinima)(curve, limit, minima);
}

void improve_minima(const ScoredCurve& curve, std::span<CurveMinimum> minima) {
  HWY_DYNAMIC_DISPATCH(ImproveMinima)(curve, minima);
}

CrossingProducts multiply(const Crossing* crossings, const std::int16_t* own, int length) {
  return HWY_DYNAMIC_DISPATCH(Multiply)(crossings, own, length);
}

ResidualSums sum_residuals(const Mixture& mixture, const std::int16_t* own, int length) {
  return HWY_DYNAMIC_DISPATCH(SumResiduals)(mixture, own, length);
}

}  // namespace pagesweep
#endif  // HWY_ONCE
