// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/sequence_search_internal.h"

#include <algorithm>
#include <cmath>
#include <limits>

// Not worth their time to compile beside SSE4, AVX2 and AVX-512.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pagesweep/matching/sequence_search.cc"
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace pagesweep::HWY_NAMESPACE {
namespace {
namespace hn = hwy::HWY_NAMESPACE;

using Doubles = hn::CappedTag<double, LineBatch::most>;
using HalfFloats = hn::Rebind<float, Doubles>;
using Floats = hn::CappedTag<float, score_padding>;
using Integers = hn::RebindToSigned<Floats>;
using DoubleVector = hn::Vec<Doubles>;
using FloatVector = hn::Vec<Floats>;
using IntegerVector = hn::Vec<Integers>;
constexpr int lanes = hn::MaxLanes(Integers());
constexpr std::int32_t highest = std::numeric_limits<std::int32_t>::max();

FloatVector set(float value) { return hn::Set(Floats(), value); }
DoubleVector set_double(double value) { return hn::Set(Doubles(), value); }

/// The part of some lines that the picture can show.
struct Depths {
  DoubleVector far, near;

  /// Narrows to where c0 + w c1 >= 0.
  void keep_where_positive(DoubleVector c0, double c1) {
    if (c1 == 0) {
      near = hn::IfThenElse(hn::Lt(c0, hn::Zero(Doubles())), far, near);
      return;
    }
    const DoubleVector bound = hn::Mul(c0, set_double(-1 / c1));
    if (c1 > 0) far = hn::Max(far, bound);
    if (c1 < 0) near = hn::Min(near, bound);
  }
};

void lay_some(const CurveFrame& frame, LineBatch& batch, std::size_t k) {
  const auto load = [&](std::size_t i) { return hn::Load(Doubles(), &batch.direction[i][k]); };
  const DoubleVector a[3] = {load(0), load(1), load(2)};
  const auto& b = frame.origin;
  Depths depths{set_double(frame.far), set_double(frame.near)};
  // In front of the camera, x/z >= lowest is x - lowest z >= 0: linear in w.
  depths.keep_where_positive(hn::Sub(a[2], set_double(1e-9)), b[2]);
  for (std::size_t i = 0; i < 2; ++i) {
    depths.keep_where_positive(hn::NegMulAdd(set_double(frame.lowest[i]), a[2], a[i]), b[i] - frame.lowest[i] * b[2]);
    depths.keep_where_positive(hn::MulSub(set_double(frame.highest[i]), a[2], a[i]), frame.highest[i] * b[2] - b[i]);
  }
  const auto at = [&](std::size_t i, DoubleVector w) { return hn::MulAdd(w, set_double(b[i]), a[i]); };
  const DoubleVector z_far = at(2, depths.far), z_near = at(2, depths.near);
  const DoubleVector scale_far = hn::Div(set_double(1), z_far), scale_near = hn::Div(set_double(1), z_near);
  const DoubleVector x = hn::Mul(at(0, depths.far), scale_far), y = hn::Mul(at(1, depths.far), scale_far);
  const DoubleVector way_x = hn::MulSub(at(0, depths.near), scale_near, x);
  const DoubleVector way_y = hn::MulSub(at(1, depths.near), scale_near, y);
  const DoubleVector u = hn::Mul(way_x, set_double(frame.lens.fx)), v = hn::Mul(way_y, set_double(frame.lens.fy));
  const DoubleVector known = hn::Add(a[0], hn::Add(a[1], a[2]));  // unless it is NaN
  const DoubleVector steps = hn::Max(set_double(1), hn::Ceil(hn::Sqrt(hn::MulAdd(u, u, hn::Mul(v, v)))));
  const DoubleVector step = hn::Div(set_double(1), steps);
  const auto seen = hn::And(hn::Lt(depths.far, depths.near), hn::Eq(known, known));
  const auto store = [&](DoubleVector value, LineBatch::Each<float>& out) {
    hn::Store(hn::DemoteTo(HalfFloats(), value), HalfFloats(), &out[k]);
  };
  store(x, batch.x);
  store(y, batch.y);
  store(hn::Mul(way_x, step), batch.dx);
  store(hn::Mul(way_y, step), batch.dy);
  store(hn::IfThenElseZero(seen, hn::Add(steps, set_double(1))), batch.count);
  store(depths.far, batch.far);
  store(depths.near, batch.near);
  store(z_far, batch.z_far);
  store(z_near, batch.z_near);
}

/// Places of a picture's lines.
struct Position {
  FloatVector along, across;
  hn::Mask<Floats> known;  ///< whether the lens is
};

/// Where the lens images ideal coordinates.
HWY_INLINE Position image(const LensNumbers& lens, bool along_rows, FloatVector x, FloatVector y) {
  const FloatVector xx = hn::Mul(x, x), yy = hn::Mul(y, y), rr = hn::Add(xx, yy);
  const FloatVector xy2 = hn::Mul(set(2), hn::Mul(x, y));
  const FloatVector radial =
      hn::MulAdd(rr, hn::MulAdd(rr, hn::MulAdd(rr, set(lens.k3), set(lens.k2)), set(lens.k1)), set(1));
  const FloatVector tangent_x = hn::MulAdd(set(lens.p1), xy2, hn::Mul(set(lens.p2), hn::MulAdd(set(2), xx, rr)));
  const FloatVector tangent_y = hn::MulAdd(set(lens.p2), xy2, hn::Mul(set(lens.p1), hn::MulAdd(set(2), yy, rr)));
  const FloatVector u = hn::MulAdd(set(lens.fx), hn::MulAdd(x, radial, tangent_x), set(lens.cx));
  const FloatVector v = hn::MulAdd(set(lens.fy), hn::MulAdd(y, radial, tangent_y), set(lens.cy));
  return {along_rows ? u : v, along_rows ? v : u, hn::Le(rr, set(lens.max_radius_squared))};
}

/// The straight lines between the curves' ends.
void lay_chords(const LensNumbers& lens, bool along_rows, LineBatch& batch, std::size_t k) {
  const auto load = [&](const LineBatch::Each<float>& values) { return hn::Load(Floats(), &values[k]); };
  const auto store = [&](FloatVector v, LineBatch::Each<float>& values) { hn::Store(v, Floats(), &values[k]); };
  const FloatVector x = load(batch.x), y = load(batch.y), dx = load(batch.dx), dy = load(batch.dy);
  const FloatVector steps = hn::Sub(load(batch.count), set(1));
  const auto at = [&](float share) {
    const FloatVector step = hn::Mul(set(share), steps);
    return image(lens, along_rows, hn::MulAdd(step, dx, x), hn::MulAdd(step, dy, y));
  };
  const Position from = at(0), middle = at(0.5f), to = at(1);
  const FloatVector way = hn::Sub(to.along, from.along);
  const FloatVector slope = hn::Div(hn::Sub(to.across, from.across), way);
  const FloatVector at_0 = hn::NegMulAdd(slope, from.along, from.across);
  const FloatVector bend = hn::Sub(hn::MulAdd(slope, middle.along, at_0), middle.across);
  const auto known = hn::And(from.known, hn::And(middle.known, to.known));
  const auto gentle = hn::And(hn::Lt(hn::Abs(bend), set(0.1f)), hn::Le(hn::Abs(slope), set(1)));
  const FloatVector back_and_forth = hn::Mul(hn::Sub(middle.along, from.along), hn::Sub(to.along, middle.along));
  const auto goes_on = hn::Gt(back_and_forth, hn::Zero(Floats()));
  store(from.along, batch.from);
  store(to.along, batch.to);
  store(at_0, batch.line_at_0);
  store(slope, batch.slope);
  store(hn::IfThenElseZero(hn::And(known, hn::And(gentle, goes_on)), set(1)), batch.straight);
}

void LayLines(const CurveFrame& frame, bool along_rows, LineBatch& batch) {
  for (std::size_t k = 0; k < LineBatch::most; k += hn::Lanes(Doubles())) lay_some(frame, batch, k);
  for (std::size_t k = 0; k < LineBatch::most; k += hn::Lanes(Floats())) lay_chords(frame.lens, along_rows, batch, k);
}

/// Compares one sequence with those along one curve.
class CurveScorer {
 public:
  CurveScorer(const SequenceArrays& to, const LensNumbers& lens, const CurveLine& line, const OwnSequence& own,
              ScoredCurve& curve)
      : to_(to), lens_(lens), line_(line), own_(own), curve_(curve) {}

  void score() {
    if (line_.straight > 0) {
      curve_.nodes.assign({line_.from, line_.to});
      begin_places(line_.from, line_.to);
      score_stretch(begin_, end_, {line_.slope, line_.line_at_0});
    } else {
      constexpr int stretch = 15;  // within it no lens bends a curve by more than some hundredths of a pixel
      const int count = static_cast<int>(line_.count);
      if (find_nodes((count + stretch - 2) / stretch + 1) && runs_along_lines()) {
        score_stretches();
      } else {
        find_nodes(count);
        score_places();
      }
    }
    hn::StoreU(hn::Set(Integers(), highest), Integers(), score_at(curve_.count));
    *pixel_at(-1) = *pixel_at(curve_.count) = nothing;
    curve_.least = hn::GetLane(hn::MinOfLanes(Integers(), least_));
  }

 private:
  /// A straight line: which of the picture's lines it is at, place by place.
  struct Chord {
    float slope, at_0;
  };

  static constexpr std::int32_t nothing = -1;

  std::int32_t* score_at(int k) { return curve_.scores.data() + score_padding + k; }
  std::int32_t* pixel_at(int k) { return curve_.pixels.data() + score_padding + k; }

  void make_room(int count) {
    const auto room = static_cast<std::size_t>(count) + 3 * score_padding;
    if (curve_.scores.size() >= room) return;
    curve_.scores.resize(room);
    curve_.pixels.resize(room);
    *score_at(-1) = highest;
  }

  /// Where the lens images evenly spaced places of the line. \return whether it is known at all of them
  bool find_nodes(int count) {
    const auto room = static_cast<std::size_t>(count) + score_padding;
    curve_.nodes.resize(room);
    curve_.across.resize(room);
    const FloatVector spacing = set((line_.count - 1) / static_cast<float>(count - 1));
    const FloatVector first = hn::Iota(Floats(), 0);
    bool known = true;
    for (int k = 0; k < count; k += lanes) {
      const FloatVector ahead = hn::Add(first, set(static_cast<float>(k))), step = hn::Mul(ahead, spacing);
      const Position node = image(lens_, to_.along_rows, hn::MulAdd(step, set(line_.dx), set(line_.x)),
                                  hn::MulAdd(step, set(line_.dy), set(line_.y)));
      const auto beyond = hn::Ge(ahead, set(static_cast<float>(count)));
      known = known && hn::AllTrue(Floats(), hn::Or(node.known, beyond));
      const FloatVector nowhere = set(std::numeric_limits<float>::quiet_NaN());
      hn::StoreU(hn::IfThenElse(node.known, node.along, nowhere), Floats(), curve_.nodes.data() + k);
      hn::StoreU(hn::IfThenElse(node.known, node.across, nowhere), Floats(), curve_.across.data() + k);
    }
    curve_.nodes.resize(static_cast<std::size_t>(count));
    curve_.across.resize(static_cast<std::size_t>(count));
    return known;
  }

  /// Whether the nodes follow each other in one direction, no steeper than about a line a place.
  bool runs_along_lines() const {
    const float sign = curve_.nodes.back() > curve_.nodes.front() ? 1.0f : -1.0f;
    for (std::size_t k = 1; k < curve_.nodes.size(); ++k) {
      const float way = sign * (curve_.nodes[k] - curve_.nodes[k - 1]);
      if (!(way > 0 && way < 1000 && std::abs(curve_.across[k] - curve_.across[k - 1]) <= 1.1f * way)) return false;
    }
    return true;
  }

  int bounded(float place) const { return static_cast<int>(std::clamp(place, 0.0f, static_cast<float>(to_.places))); }

  /// Makes room for the places nearest to those between two; blocks of them, from the lowest one's on.
  void begin_places(float a, float b) {
    begin_ = bounded(std::ceil(std::min(a, b) - 0.5f));
    end_ = std::max(begin_, bounded(std::floor(std::max(a, b) + 0.5f) + 1));
    first_ = begin_ / score_padding * score_padding;
    curve_.first = static_cast<float>(first_);
    curve_.count = end_ - first_;
    make_room(curve_.count);
    for (int k = 0; k < curve_.count; k += lanes) {
      hn::StoreU(hn::Set(Integers(), highest), Integers(), score_at(k));
      hn::StoreU(hn::Set(Integers(), nothing), Integers(), pixel_at(k));
    }
  }

  /// Straight from node to node.
  void score_stretches() {
    const auto& along = curve_.nodes;
    const std::size_t last = along.size() - 1;
    begin_places(along.front(), along.back());
    const bool ascends = along[last] > along[0];
    int at = begin_;
    for (std::size_t s = 0; s < last; ++s) {
      const std::size_t from = ascends ? s : last - s, to = ascends ? from + 1 : from - 1;
      const int stop = s == last - 1 ? end_ : std::min(end_, bounded(std::ceil(along[to])));
      const float slope = (curve_.across[to] - curve_.across[from]) / (along[to] - along[from]);
      score_stretch(at, stop, {slope, curve_.across[from] - slope * along[from]});
      at = std::max(at, stop);
    }
  }

  /// Places at ... stop - 1, which lie on a straight line: in runs along one of the picture's lines each.
  void score_stretch(int at, int stop, const Chord& chord) {
    const float steepness = std::abs(chord.slope);
    while (at < stop) {
      const float across = chord.at_0 + chord.slope * static_cast<float>(at), line = std::floor(across + 0.5f);
      const float room = chord.slope > 0 ? line + 0.5f - across : across - (line - 0.5f);  // until the next is nearer
      int count = stop - at;
      if (room < steepness * static_cast<float>(count))
        count = std::min(count, std::max(1, static_cast<int>(std::ceil(room / steepness))));
      if (line >= 0 && line < static_cast<float>(to_.lines)) score_run(static_cast<int>(line), at, at + count);
      at += count;
    }
  }

  /// The places first ... last - 1 of a line, whole vectors at a time.
  void score_run(int line, int first, int last) {
    const Integers tag;
    const IntegerVector ahead = hn::Iota(tag, 0);
    const int begin = first / lanes * lanes;
    const std::int32_t* there = to_.sequence(line, begin);
    const std::int32_t index = to_.index(line, begin);
    for (int k = 0; begin + k < last; k += lanes) {
      const auto inside =
          hn::And(hn::Gt(ahead, hn::Set(tag, first - 1 - begin - k)), hn::Lt(ahead, hn::Set(tag, last - begin - k)));
      std::int32_t *out = score_at(begin - first_ + k), *pixels = pixel_at(begin - first_ + k);
      const IntegerVector scores = hn::IfThenElse(inside, score(there + k, index + k), hn::LoadU(tag, out));
      const IntegerVector here = hn::Add(ahead, hn::Set(tag, index + k));
      hn::StoreU(scores, tag, out);
      hn::StoreU(hn::IfThenElse(inside, here, hn::LoadU(tag, pixels)), tag, pixels);
      least_ = hn::Min(least_, scores);
    }
  }

  /// Places that the CurveLine's own follow about a pixel apart, one by one.
  void score_places() {
    const auto nearest = [](float p, int size) {
      return p >= -0.5f && p <= static_cast<float>(size) - 0.5f
                 ? std::clamp(static_cast<int>(std::floor(p + 0.5f)), 0, size - 1)
                 : -1;
    };
    curve_.first = std::numeric_limits<float>::quiet_NaN();
    curve_.count = static_cast<int>(line_.count);
    make_room(curve_.count);
    for (int k = 0; k < curve_.count; ++k) {
      const auto node = static_cast<std::size_t>(k);
      const int place = nearest(curve_.nodes[node], to_.places), line = nearest(curve_.across[node], to_.lines);
      *score_at(k) = highest;
      *pixel_at(k) = nothing;
      if (place < 0 || line < 0) continue;
      const std::int32_t pixel = to_.index(line, place);
      *pixel_at(k) = pixel;
      *score_at(k) = hn::GetLane(score(to_.sequence(line, place), pixel));
      least_ = hn::Min(least_, hn::Set(Integers(), *score_at(k)));
    }
  }

  /// Sums of squared differences from the sequences of consecutive places.
  HWY_INLINE IntegerVector score(const std::int32_t* there, std::int32_t index) const {
    const Integers tag;
    const IntegerVector squares =
        to_.squares ? hn::LoadU(tag, to_.squares + index) : hn::Set(tag, sequence_scale * sequence_scale);
    return hn::Sub(hn::Add(squares, hn::Set(tag, own_.square)), hn::ShiftLeft<1>(products(there)));
  }

  /// Scalar products with the sequences of consecutive places.
  HWY_INLINE IntegerVector products(const std::int32_t* there) const {
    const Integers tag;
#if HWY_TARGET == HWY_SCALAR
    std::int32_t sum = 0;
    for (int j = 0; j < to_.pairs; ++j, there += to_.stride) sum += multiply_pairs(*there, own_.pair(j));
    return hn::Set(tag, sum);
#else
    const hn::Repartition<std::int16_t, Integers> samples;
    IntegerVector sum = hn::Zero(tag), more = sum;
    for (int j = 0; j < to_.pairs; ++j, there += to_.stride)
      sum = hn::ReorderWidenMulAccumulate(tag, hn::BitCast(samples, hn::LoadU(tag, there)),
                                          hn::BitCast(samples, hn::Set(tag, own_.pair(j))), sum, more);
    return hn::RearrangeToOddPlusEven(sum, more);
#endif
  }

  const SequenceArrays& to_;
  const LensNumbers& lens_;
  const CurveLine& line_;
  const OwnSequence& own_;
  ScoredCurve& curve_;
  int begin_ = 0, end_ = 0;  ///< places
  int first_ = 0;            ///< that which stands first
  IntegerVector least_ = hn::Set(Integers(), highest);
};

void ScoreCurve(const SequenceArrays& to, const LensNumbers& lens, const CurveLine& line, const OwnSequence& own,
                ScoredCurve& curve) {
  CurveScorer(to, lens, line, own, curve).score();
}

void FindMinima(const ScoredCurve& curve, std::int32_t limit, CurveMinima& minima) {
  const Integers tag;
  minima.make_room(curve.count);
  int found = 0;
  for (int first = 0; first < curve.count; first += lanes) {
    const std::int32_t* scores = curve.first_score() + first;
    const IntegerVector here = hn::LoadU(tag, scores);
    const IntegerVector before = hn::LoadU(tag, scores - 1), behind = hn::LoadU(tag, scores + 1);
    const auto too_large = hn::Or(hn::Gt(here, hn::Set(tag, limit)), hn::Gt(here, behind));
    const auto is_minimum = hn::AndNot(too_large, hn::Lt(here, before));
    if (hn::AllFalse(tag, is_minimum)) continue;
    const IntegerVector place = hn::Iota(tag, first);
    const IntegerVector side = hn::IfThenElse(hn::Lt(before, behind), hn::Set(tag, -1), hn::Set(tag, 1));
    const auto keep = [&](IntegerVector values, std::vector<std::int32_t>& out) {
      hn::StoreU(hn::Compress(values, is_minimum), tag, &out[static_cast<std::size_t>(found)]);
    };
    keep(place, minima.place);
    keep(here, minima.score);
    keep(hn::Add(place, side), minima.beside);
    keep(hn::Min(before, behind), minima.beside_score);
    found += static_cast<int>(hn::CountTrue(tag, is_minimum));
  }
  // Behind the end all scores are the highest, which a limit is below.
  minima.count = found;
}

/// What is known of a vector of minima and the places beside, but for their scores.
struct MinimaProducts {
  alignas(64) float is_pair[lanes], here[lanes], beside[lanes], both[lanes];  ///< 1 or 0; scalar products

  MinimaProducts(const SequenceArrays& to, const ScoredCurve& curve, const CurveMinima& minima, std::size_t first) {
    const auto square = [&](std::int32_t pixel) {
      return static_cast<float>(to.squares ? to.squares[pixel] : sequence_scale * sequence_scale);
    };
    const FloatVector zero = hn::Zero(Floats());
    for (float* values : {is_pair, here, beside, both}) hn::Store(zero, Floats(), values);
    const std::size_t count = std::min<std::size_t>(lanes, static_cast<std::size_t>(minima.count) - first);
    for (std::size_t k = 0; k < count; ++k) {
      const std::int32_t a = curve.pixel_at(minima.place[first + k]), b = curve.pixel_at(minima.beside[first + k]);
      if (a == b || b < 0) continue;
      is_pair[k] = 1;
      here[k] = square(a);
      beside[k] = square(b);
      both[k] = static_cast<float>(std::abs(a - b) == 1 ? to.next[std::min(a, b)] : multiply(to, a, b));
    }
  }
};

/// How near a sequence g comes to the lines between pairs of pixels.
void improve_some(const MinimaProducts& products, FloatVector gg, bool affine, std::size_t first, CurveMinima& minima) {
  const Integers tag;
  const auto integers = [&](const std::vector<std::int32_t>& values) { return hn::LoadU(tag, &values[first]); };
  const FloatVector score = hn::ConvertTo(Floats(), integers(minima.score));
  const FloatVector beside_score = hn::ConvertTo(Floats(), integers(minima.beside_score));
  const FloatVector place = hn::ConvertTo(Floats(), integers(minima.place));
  const FloatVector way = hn::Sub(hn::ConvertTo(Floats(), integers(minima.beside)), place);
  const FloatVector s0 = hn::Load(Floats(), products.here), s1 = hn::Load(Floats(), products.beside);
  const FloatVector s01 = hn::Load(Floats(), products.both);
  const FloatVector g0 = hn::Mul(set(0.5f), hn::Sub(hn::Add(gg, s0), score));
  const FloatVector g1 = hn::Mul(set(0.5f), hn::Sub(hn::Add(gg, s1), beside_score));
  const FloatVector length_squared = hn::Add(hn::NegMulAdd(set(2), s01, s0), s1);
  FloatVector part, whole;
  if (affine) {  // g's coefficients in the plane, times a determinant
    part = hn::MulSub(g1, s0, hn::Mul(g0, s01));
    whole = hn::Add(part, hn::MulSub(g0, s1, hn::Mul(g1, s01)));
  } else {
    part = hn::Add(hn::Sub(g1, g0), hn::Sub(s0, s01));
    whole = length_squared;
  }
  const auto is_known = hn::Gt(whole, hn::Zero(Floats()));
  const FloatVector quotient = hn::IfThenElseZero(is_known, hn::Div(part, whole));
  const FloatVector share = hn::Min(hn::Max(quotient, hn::Zero(Floats())), set(1));
  const FloatVector gs = hn::MulAdd(share, hn::Sub(g1, g0), g0);
  const FloatVector ss = hn::MulAdd(share, hn::MulAdd(share, length_squared, hn::Mul(set(2), hn::Sub(s01, s0))), s0);
  const auto alike = hn::And(hn::Gt(gs, hn::Zero(Floats())), hn::Gt(ss, hn::Zero(Floats())));
  const FloatVector distance = affine ? hn::IfThenElse(alike, hn::NegMulAdd(gs, hn::Div(gs, ss), gg), gg)
                                      : hn::Add(hn::NegMulAdd(set(2), gs, gg), ss);
  const auto is_pair = hn::Gt(hn::Load(Floats(), products.is_pair), hn::Zero(Floats()));
  hn::StoreU(hn::IfThenElse(is_pair, hn::MulAdd(share, way, place), place), Floats(), &minima.improved_place[first]);
  hn::StoreU(hn::IfThenElse(is_pair, distance, score), Floats(), &minima.distance_squared[first]);
}

void ImproveMinima(const SequenceArrays& to, const ScoredCurve& curve, std::int32_t own_square, bool affine,
                   CurveMinima& minima) {
  for (std::size_t first = 0; first < static_cast<std::size_t>(minima.count); first += lanes)
    improve_some({to, curve, minima, first}, set(static_cast<float>(own_square)), affine, first, minima);
}

}  // namespace
}  // namespace pagesweep::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pagesweep {

HWY_EXPORT(LayLines);
HWY_EXPORT(ScoreCurve);
HWY_EXPORT(FindMinima);
HWY_EXPORT(ImproveMinima);

void lay_lines(const CurveFrame& frame, bool along_rows, LineBatch& batch) {
  HWY_DYNAMIC_DISPATCH(LayLines)(frame, along_rows, batch);
}

void score_curve(const SequenceArrays& to, const LensNumbers& lens, const CurveLine& line, const OwnSequence& own,
                 ScoredCurve& curve) {
  HWY_DYNAMIC_DISPATCH(ScoreCurve)(to, lens, line, own, curve);
}

void find_minima(const ScoredCurve& curve, std::int32_t limit, CurveMinima& minima) {
  HWY_DYNAMIC_DISPATCH(FindMinima)(curve, limit, minima);
}

void improve_minima(const SequenceArrays& to, const ScoredCurve& curve, std::int32_t own_square, bool affine,
                    CurveMinima& minima) {
  HWY_DYNAMIC_DISPATCH(ImproveMinima)(to, curve, own_square, affine, minima);
}

void CurveMinima::make_room(int entries) {
  const std::size_t room = static_cast<std::size_t>(entries) / 2 + 1 + score_padding;  // whole vectors are written
  if (place.size() >= room) return;
  for (auto* values : {&place, &score, &beside, &beside_score}) values->resize(room);
  for (auto* values : {&improved_place, &distance_squared}) values->resize(room);
}

float ScoredCurve::share_at(float place) const {
  const auto stretches = static_cast<float>(nodes.size() - 1);
  if (!(first == first)) return std::clamp(place / stretches, 0.0f, 1.0f);
  const float wanted = first + place;
  const bool ascends = nodes.back() > nodes.front();
  std::size_t k = 0;
  while (k + 2 < nodes.size() && (nodes[k + 1] < wanted) == ascends) ++k;
  const float within = (wanted - nodes[k]) / (nodes[k + 1] - nodes[k]);
  return std::clamp((static_cast<float>(k) + within) / stretches, 0.0f, 1.0f);
}

}  // namespace pagesweep
#endif  // HWY_ONCE
