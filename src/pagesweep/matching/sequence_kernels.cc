// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

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
using FloatVector = hn::Vec<Floats>;
using IntegerVector = hn::Vec<Integers>;
constexpr int lanes = hn::MaxLanes(Integers());

FloatVector set(float value) { return hn::Set(Floats(), value); }

#if HWY_TARGET == HWY_SCALAR
void MultiplyNeighbours(const SequenceArrays& arrays, int line, std::int32_t* own, std::int32_t* next) {
  for (int k = 0; k < arrays.places; ++k) {
    const std::int32_t* pair = arrays.sequence(line, k);
    own[k] = next[k] = 0;
    for (int j = 0; j < arrays.pairs; ++j, pair += arrays.stride) {
      own[k] += multiply_pairs(pair[0], pair[0]);
      next[k] += multiply_pairs(pair[0], pair[1]);
    }
  }
}

/// The j-th pair of a crossing.
std::int32_t interpolate(const SequenceArrays& to, const Crossings& crossings, std::size_t k, int j) {
  const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(j) * to.stride;
  std::int16_t low[2], high[2];
  hwy::CopyBytes<4>(crossings.low[k] + at, low);
  hwy::CopyBytes<4>(crossings.high[k] + at, high);
  for (int i = 0; i < 2; ++i)
    low[i] =
        static_cast<std::int16_t>(low[i] + (((high[i] - low[i]) * (crossings.share[k] & 0x7fff) + (1 << 14)) >> 15));
  std::int32_t pair;
  hwy::CopyBytes<4>(low, &pair);
  return pair;
}

CrossingProducts Multiply(const SequenceArrays& to, const Crossings& crossings, const OwnSequence& own) {
  CrossingProducts products{};
  for (int j = 0; j < to.pairs; ++j)
    for (std::size_t a = 0; a < Crossings::count; ++a) {
      const std::int32_t s = interpolate(to, crossings, a, j);
      products.gs[a] += multiply_pairs(s, own.pair(j));
      for (std::size_t b = a; b < Crossings::count; ++b)
        products.ss[a][b] += multiply_pairs(s, interpolate(to, crossings, b, j));
    }
  return products;
}

void Enter(const SequenceArrays& to, const Crossings& crossings, const OwnSequence& own, std::size_t pixel,
           MixtureBatch& batch) {
  for (int j = 0; j < to.pairs; ++j) {
    const std::size_t at = static_cast<std::size_t>(j) * MixtureBatch::most + pixel;
    batch.own[at] = own.pair(j);
    for (std::size_t k = 0; k < Crossings::count; ++k)
      batch.crossings[at * Crossings::count + k] = interpolate(to, crossings, k, j);
  }
}
#else
/// Sums of products of pairs.
template <class D>
class PairSums {
 public:
  using Vector = hn::Vec<D>;

  HWY_INLINE PairSums() : sum_(hn::Zero(D())), more_(sum_) {}
  HWY_INLINE void add(Vector a, Vector b) {
    const hn::Repartition<std::int16_t, D> samples;
    sum_ = hn::ReorderWidenMulAccumulate(D(), hn::BitCast(samples, a), hn::BitCast(samples, b), sum_, more_);
  }
  HWY_INLINE Vector total() const { return hn::RearrangeToOddPlusEven(sum_, more_); }

 private:
  Vector sum_, more_;
};

/// The four crossings of one pixel, side by side.
class CrossingReader {
 public:
  using Tag = hn::Full128<std::int32_t>;
  using Vector = hn::Vec<Tag>;

  CrossingReader(const SequenceArrays& to, const Crossings& crossings)
      : crossings_(crossings), stride_(to.stride), share_(hn::BitCast(samples, hn::LoadU(Tag(), crossings.share))) {}

  /// The j-th pair of each, interpolated.
  HWY_INLINE Vector read(int j) const {
    const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(j) * stride_;
    const auto low = hn::BitCast(samples, load(crossings_.low, at));
    const auto high = hn::BitCast(samples, load(crossings_.high, at));
    return hn::BitCast(Tag(), hn::Add(low, hn::MulFixedPoint15(hn::Sub(high, low), share_)));
  }

 private:
  static constexpr hn::Full128<std::int16_t> samples{};

  HWY_INLINE Vector load(const std::array<const std::int32_t*, Crossings::count>& places, std::ptrdiff_t at) const {
    if (crossings_.are_neighbours) return hn::LoadU(Tag(), places[0] + at);
    alignas(16) const std::int32_t pairs[] = {places[0][at], places[1][at], places[2][at], places[3][at]};
    return hn::Load(Tag(), pairs);
  }

  const Crossings& crossings_;
  int stride_;
  hn::Vec<hn::Full128<std::int16_t> > share_;
};

void MultiplyNeighbours(const SequenceArrays& arrays, int line, std::int32_t* own, std::int32_t* next) {
  const Integers tag;
  for (int k = 0; k < arrays.places; k += lanes) {
    PairSums<Integers> with_own, with_next;
    const std::int32_t* pair = arrays.sequence(line, k);
    for (int j = 0; j < arrays.pairs; ++j, pair += arrays.stride) {
      const IntegerVector here = hn::LoadU(tag, pair);
      with_own.add(here, here);
      with_next.add(here, hn::LoadU(tag, pair + 1));
    }
    hn::StoreU(with_own.total(), tag, own + k);
    hn::StoreU(with_next.total(), tag, next + k);
  }
}

CrossingProducts Multiply(const SequenceArrays& to, const Crossings& crossings, const OwnSequence& own) {
  using Tag = CrossingReader::Tag;
  const CrossingReader reader(to, crossings);
  PairSums<Tag> with_own, with_same, with_next, with_second;
  for (int j = 0; j < to.pairs; ++j) {
    const auto s = reader.read(j);
    with_own.add(s, hn::Set(Tag(), own.pair(j)));
    with_same.add(s, s);
    with_next.add(s, hn::Shuffle0321(s));
    with_second.add(s, hn::Shuffle1032(s));
  }
  alignas(16) std::int32_t same[4], next[4], second[4];
  CrossingProducts products{};
  hn::StoreU(with_own.total(), Tag(), products.gs);
  hn::Store(with_same.total(), Tag(), same);
  hn::Store(with_next.total(), Tag(), next);
  hn::Store(with_second.total(), Tag(), second);
  for (int k = 0; k < 4; ++k) products.ss[k][k] = same[k];
  for (int k = 0; k < 3; ++k) products.ss[k][k + 1] = next[k];
  for (int k = 0; k < 2; ++k) products.ss[k][k + 2] = second[k];
  products.ss[0][3] = next[3];
  return products;
}

void Enter(const SequenceArrays& to, const Crossings& crossings, const OwnSequence& own, std::size_t pixel,
           MixtureBatch& batch) {
  const CrossingReader reader(to, crossings);
  std::int32_t* out = batch.crossings.data() + pixel * Crossings::count;
  for (int j = 0; j < to.pairs; ++j, out += MixtureBatch::most * Crossings::count) {
    hn::StoreU(reader.read(j), CrossingReader::Tag(), out);
    batch.own[static_cast<std::size_t>(j) * MixtureBatch::most + pixel] = own.pair(j);
  }
}
#endif

/// The sums of some pixels.
class Residuals {
 public:
  Residuals(const MixtureBatch& batch, std::size_t first) : batch_(batch), first_(first) {
    for (std::size_t k = 0; k < Crossings::count; ++k) {
      value_[k] = hn::Load(Floats(), &batch.value[k][first]);
      change_[k] = hn::Load(Floats(), &batch.change[k][first]);
    }
    change_of_own_ = hn::Load(Floats(), &batch.change_of_own[first]);
  }

  void add(std::size_t pair) {
    const Integers tag;
    const std::size_t at = pair * MixtureBatch::most + first_;
    const IntegerVector own = hn::LoadU(tag, batch_.own.data() + at);
    IntegerVector s[Crossings::count];
    hn::LoadInterleaved4(tag, batch_.crossings.data() + at * Crossings::count, s[0], s[1], s[2], s[3]);
    add_frame([](IntegerVector v) { return hn::ShiftRight<16>(hn::ShiftLeft<16>(v)); }, own, s);
    add_frame([](IntegerVector v) { return hn::ShiftRight<16>(v); }, own, s);
  }

  void store(MixtureBatch& out) const { hn::Store(rrdd_, Floats(), &out.rrdd[first_]); }

 private:
  template <class Half>
  HWY_INLINE void add_frame(const Half& half, IntegerVector own, const IntegerVector* s) {
    const FloatVector g = hn::ConvertTo(Floats(), half(own));
    FloatVector r = g, d = hn::Mul(g, change_of_own_);
    for (std::size_t k = 0; k < Crossings::count; ++k) {
      const FloatVector there = hn::ConvertTo(Floats(), half(s[k]));
      r = hn::NegMulAdd(there, value_[k], r);
      d = hn::MulAdd(there, change_[k], d);
    }
    const FloatVector rd = hn::Mul(r, d);
    rrdd_ = hn::MulAdd(rd, rd, rrdd_);
  }

  const MixtureBatch& batch_;
  std::size_t first_;
  FloatVector value_[Crossings::count], change_[Crossings::count], change_of_own_;
  FloatVector rrdd_ = hn::Zero(Floats());
};

void SumWeightedResiduals(int pairs, MixtureBatch& batch) {
  for (std::size_t first = 0; first < MixtureBatch::most; first += static_cast<std::size_t>(lanes)) {
    Residuals residuals(batch, first);
    for (int j = 0; j < pairs; ++j) residuals.add(static_cast<std::size_t>(j));
    residuals.store(batch);
  }
}

HWY_INLINE FloatVector load(const float* samples) { return hn::LoadU(Floats(), samples); }
HWY_INLINE FloatVector load(const std::uint8_t* samples) {
  const hn::Rebind<std::uint8_t, Floats> bytes;
  return hn::ConvertTo(Floats(), hn::PromoteTo(Integers(), hn::LoadU(bytes, samples)));
}

/// As many pixels of the rows as a vector has lanes.
template <class Sample>
class PixelColumn {
 public:
  PixelColumn(const SampleRows<Sample>& gray, int first) : gray_(gray), first_(first) {}

  HWY_INLINE FloatVector at(std::size_t frame) const {
    const FloatVector gray = hn::Sub(load(gray_.frames[frame] + first_), set(gray_.black_level));
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

  /// Two frames at a time.
  void pack(FloatVector offset, FloatVector scale, const PairPlaces& out) const {
    const auto sample = [&](std::size_t i) {
      return i < gray_.frames.size() ? hn::NearestInt(hn::Mul(hn::Sub(at(i), offset), scale)) : hn::Zero(Integers());
    };
    const int pixels = std::min(lanes, gray_.pixels - first_);
    std::int32_t* there = out.first + first_ * out.pixel_step;
    alignas(64) std::int32_t pairs[lanes];
    for (std::size_t i = 0; i < gray_.frames.size(); i += 2, there += out.pair_step) {
      const IntegerVector low = hn::And(sample(i), hn::Set(Integers(), 0xffff)),
                          high = hn::ShiftLeft<16>(sample(i + 1));
      if (out.pixel_step == 1) {
        hn::StoreU(hn::Or(low, high), Integers(), there);
      } else {
        hn::Store(hn::Or(low, high), Integers(), pairs);
        for (int p = 0; p < pixels; ++p) there[p * out.pixel_step] = pairs[p];
      }
    }
  }

 private:
  const SampleRows<Sample>& gray_;
  int first_;
};

template <class Sample>
void pack(const SampleRows<Sample>& gray, bool affine, const PairPlaces& out, const SequenceStatistics& statistics) {
  const FloatVector full_size = set(gray.range * std::sqrt(static_cast<float>(gray.frames.size())));
  for (int first = 0; first < gray.pixels; first += lanes) {
    const PixelColumn<Sample> column(gray, first);
    FloatVector energy;
    const FloatVector mean = column.summarise(statistics, energy);
    const FloatVector size = affine ? hn::Sqrt(hn::Max(energy, set(1e-6f))) : full_size;
    const FloatVector scale = hn::Div(set(sequence_scale), size);
    hn::StoreU(scale, Floats(), statistics.scale + first);
    column.pack(affine ? mean : hn::Zero(Floats()), scale, out);
  }
}

void PackGray(const GrayRows& gray, bool affine, const PairPlaces& out, const SequenceStatistics& statistics) {
  pack(gray, affine, out, statistics);
}
void PackBytes(const ByteRows& gray, bool affine, const PairPlaces& out, const SequenceStatistics& statistics) {
  pack(gray, affine, out, statistics);
}

}  // namespace
}  // namespace pagesweep::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pagesweep {

HWY_EXPORT(PackGray);
HWY_EXPORT(PackBytes);
HWY_EXPORT(MultiplyNeighbours);
HWY_EXPORT(Multiply);
HWY_EXPORT(Enter);
HWY_EXPORT(SumWeightedResiduals);

void pack_sequences(const GrayRows& gray, bool affine, const PairPlaces& out, const SequenceStatistics& statistics) {
  HWY_DYNAMIC_DISPATCH(PackGray)(gray, affine, out, statistics);
}

void pack_sequences(const ByteRows& gray, bool affine, const PairPlaces& out, const SequenceStatistics& statistics) {
  HWY_DYNAMIC_DISPATCH(PackBytes)(gray, affine, out, statistics);
}

void multiply_neighbours(const SequenceArrays& arrays, int line, std::int32_t* own, std::int32_t* next) {
  HWY_DYNAMIC_DISPATCH(MultiplyNeighbours)(arrays, line, own, next);
}

CrossingProducts multiply(const SequenceArrays& to, const Crossings& crossings, const OwnSequence& own) {
  return HWY_DYNAMIC_DISPATCH(Multiply)(to, crossings, own);
}

void enter(const SequenceArrays& to, const Crossings& crossings, const OwnSequence& own, std::size_t pixel,
           MixtureBatch& batch) {
  HWY_DYNAMIC_DISPATCH(Enter)(to, crossings, own, pixel, batch);
}

void sum_weighted_residuals(int pairs, MixtureBatch& batch) {
  HWY_DYNAMIC_DISPATCH(SumWeightedResiduals)(pairs, batch);
}

}  // namespace pagesweep
#endif  // HWY_ONCE
