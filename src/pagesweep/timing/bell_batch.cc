// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/bell_batch_internal.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "pagesweep/timing/mills_ratio_internal.h"

// Not worth their time to compile beside SSE4, AVX2 and AVX-512.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pagesweep/timing/bell_batch.cc"
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace pagesweep::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Floats = hn::CappedTag<float, most_bells>;
using Integers = hn::RebindToSigned<Floats>;
using Vector = hn::Vec<Floats>;
using Mask = hn::Mask<Floats>;
using Each = BellBatch::Each<float>;

/// Partial sums of `Count` quantities for every bell, half a vector each, and their totals.
template <int Count>
class Sums {
 public:
  void put(int bell, const Vector (&sums)[Count]) {
#if HWY_TARGET == HWY_SCALAR
    for (int s = 0; s < Count; ++s) partial_[s * most_bells + bell] = hn::GetLane(sums[s]);
#else
    const hn::Half<Floats> half;
    for (int s = 0; s < Count; ++s)
      hn::StoreU(hn::Add(hn::LowerHalf(half, sums[s]), hn::UpperHalf(half, sums[s])), half, row(s, bell));
#endif
  }
  /// Of quantity s, for every bell.
  void total(int s, Each& totals) {
    const int lanes = static_cast<int>(hn::Lanes(Floats()));
    for (int first = 0; first < most_bells; first += lanes)
      hn::StoreU(total_of(row(s, first), lanes), Floats(), &totals[static_cast<std::size_t>(first)]);
  }

 private:
  static int row_length() { return std::max(1, static_cast<int>(hn::Lanes(Floats())) / 2); }
  float* row(int s, int bell) { return partial_ + (s * most_bells + bell) * row_length(); }

  /// Sums of as many rows as vectors have lanes, one a lane. Each pass adds neighbours, and halves their number.
  static Vector total_of(float* rows, int lanes) {
    const Floats d;
#if HWY_TARGET == HWY_SCALAR
    (void)lanes;
#else
    for (int left = lanes / 2; left > 1; left /= 2)
      for (int k = 0; k < left / 2; ++k) {
        const Vector a = hn::Load(d, rows + 2 * k * lanes), b = hn::Load(d, rows + (2 * k + 1) * lanes);
        hn::Store(hn::Add(hn::ConcatEven(d, b, a), hn::ConcatOdd(d, b, a)), d, rows + k * lanes);
      }
#endif
    return hn::Load(d, rows);
  }

  HWY_ALIGN float partial_[Count * most_bells * most_bells / 2];
};

/// Where the bells lie in their tables and their samples.
struct Places {
  alignas(64) Each time;   ///< [frames] of a bell exactly on the table's row
  alignas(64) Each phase;  ///< [frames] of the row
  alignas(64) BellBatch::Each<std::int32_t> row, frame;

  std::size_t entry(std::size_t i, const BellTable& table) const {
    return static_cast<std::size_t>(row[i] * table.length);
  }
  /// Entry of the samples that belongs to the row's first.
  std::ptrdiff_t first(std::size_t i, const BellBatch& batch) const {
    return batch.middle + frame[i] - batch.table[i]->reach;
  }
};

/// Calls body(first lane) for all bells, as many as vectors have lanes at a time.
template <class Body>
void for_bells(const Body& body) {
  for (std::size_t i = 0; i < most_bells; i += hn::Lanes(Floats())) body(i);
}

void find_places(const BellBatch& batch, Places& places) {
  const Floats d;
  const Integers integers;
  const Vector half = hn::Set(d, 0.5F), phases = hn::Set(d, static_cast<float>(BellTable::phases));
  for_bells([&](std::size_t i) {
    const Vector time = hn::Load(d, &batch.time[i]);
    const Vector whole = hn::Floor(hn::Add(time, half));
    const auto row = hn::ConvertTo(integers, hn::MulAdd(hn::Add(hn::Sub(time, whole), half), phases, half));
    const Vector phase = hn::Sub(hn::Div(hn::ConvertTo(d, row), phases), half);
    hn::Store(row, integers, &places.row[i]);
    hn::Store(hn::ConvertTo(integers, whole), integers, &places.frame[i]);
    hn::Store(phase, d, &places.phase[i]);
    hn::Store(hn::Add(whole, phase), d, &places.time[i]);
  });
}

Vector clamped(Vector x, float most) {
  const Floats d;
  return hn::Min(hn::Max(x, hn::Set(d, -most)), hn::Set(d, most));
}

Mask good_bells(const BellBatch& batch, std::size_t i) {
  return hn::Gt(hn::Load(Floats(), &batch.good[i]), hn::Zero(Floats()));
}

/// Whether a bell still moves.
bool is_open(const BellBatch& batch, std::size_t i) { return batch.good[i] > 0 && batch.arrived[i] == 0; }
Mask open_bells(const BellBatch& batch, std::size_t i) {
  const Floats d;
  return hn::AndNot(hn::Gt(hn::Load(d, &batch.arrived[i]), hn::Zero(d)), good_bells(batch, i));
}

/// Replaces values of some bells.
void keep(Mask mask, Vector values, Each& all, std::size_t i) {
  const Floats d;
  hn::Store(hn::IfThenElse(mask, values, hn::Load(d, &all[i])), d, &all[i]);
}

/// The scalar products of the least squares solution for the bells that still move: amplitude, background, slope.
void project(const BellBatch& batch, const Places& places, Sums<3>& sums) {
  const Floats d;
  const auto lanes = static_cast<int>(hn::Lanes(d));
  for (int bell = 0; bell < batch.count; ++bell) {
    const auto i = static_cast<std::size_t>(bell);
    if (!is_open(batch, i)) continue;
    const BellTable& table = *batch.table[i];
    const std::size_t row = places.entry(i, table);
    const float *amplitude_weight = &table.amplitude_weight[row], *slope_weight = &table.slope_weight[row];
    const float* background_weight = &table.background_weight[row];
    const float* gray_row = batch.gray[i] + places.first(i, batch);
    Vector part[3] = {hn::Zero(d), hn::Zero(d), hn::Zero(d)};
    for (int k = 0; k < table.length; k += lanes) {
      const Vector gray = hn::LoadU(d, gray_row + k);
      part[0] = hn::MulAdd(hn::LoadU(d, amplitude_weight + k), gray, part[0]);
      part[1] = hn::MulAdd(hn::LoadU(d, background_weight + k), gray, part[1]);
      part[2] = hn::MulAdd(hn::LoadU(d, slope_weight + k), gray, part[2]);
    }
    sums.put(bell, part);
  }
}

void Approach(BellBatch& batch) {
  constexpr int most_steps = 6;
  const Floats d;
  alignas(64) Each amplitudes, backgrounds, slopes;
  Places places;
  Sums<3> sums;
  bool is_near = false;
  batch.arrived.fill(0);
  for (int step = 0; step < most_steps && !is_near; ++step) {
    find_places(batch, places);
    project(batch, places, sums);
    sums.total(0, amplitudes);
    sums.total(1, backgrounds);
    sums.total(2, slopes);
    is_near = true;
    for_bells([&](std::size_t i) {
      // A bell that is late by x has the slope -amplitude x in it.
      const Vector amplitude = hn::Load(d, &amplitudes[i]), before = hn::Load(d, &batch.time[i]);
      const Vector late = hn::Neg(hn::Div(hn::Load(d, &slopes[i]), amplitude));
      const Vector time = hn::Add(hn::Load(d, &places.time[i]), clamped(late, batch.longest_step));
      const Mask open = open_bells(batch, i);
      const Mask good =
          hn::And(open, hn::And(hn::Gt(amplitude, hn::Zero(d)), hn::Le(hn::Abs(time), hn::Set(d, batch.most_moved))));
      keep(open, amplitude, batch.amplitude, i);
      keep(open, hn::Load(d, &backgrounds[i]), batch.background, i);
      keep(open, hn::IfThenElseZero(good, time), batch.time, i);
      keep(open, hn::IfThenElseZero(good, hn::Set(d, 1.0F)), batch.good, i);
      const Mask far = hn::And(good, hn::Ge(hn::Abs(hn::Sub(time, before)), hn::Set(d, batch.near)));
      keep(hn::AndNot(far, good), hn::Set(d, 1.0F), batch.arrived, i);
      is_near = is_near && hn::AllFalse(d, far);
    });
  }
}

/// Sums over the samples of a bell that make the normal equations of a Gauss-Newton step. p is the profile and n = 1
/// the background, s the profile's slope and r the residuals; x and y are further columns of the design, if any.
enum Sum { pp, p1, n1, ps, s1, ss, rp, r1, rs, rr, px, x1, sx, xx, rx, py, y1, sy, xy, yy, ry, most_sums };
constexpr int sums_of(int extra_columns) { return extra_columns == 0 ? px : extra_columns == 1 ? py : most_sums; }

struct Equations {
  alignas(64) Each of[most_sums];
};

/// The profile and its slope at samples x frames later than those of the table: Taylor's second order, the bend being
/// the slope's change from sample to sample.
struct Shifted {
  Vector profile, slope;
};
Shifted shift(const BellTable& table, std::size_t at, Vector slope, Vector x) {
  const Floats d;
  const std::size_t end = table.slope.size() - hn::Lanes(d);
  const Vector before = hn::LoadU(d, &table.slope[at > 0 ? at - 1 : 0]);
  const Vector after = hn::LoadU(d, &table.slope[std::min(at + 1, end)]);
  const Vector bend = hn::Mul(hn::Set(d, 0.5F), hn::Sub(after, before));
  const Vector half_way = hn::MulAdd(hn::Mul(hn::Set(d, 0.5F), x), bend, slope);
  return {hn::MulAdd(x, half_way, hn::LoadU(d, &table.value[at])), hn::MulAdd(x, bend, slope)};
}

/// Some samples of a bell: their weights, the model's derivatives, and what the model leaves of the samples.
struct Samples {
  Vector weight, profile, slope, residual;
  Vector pull;  ///< weight times residual, unless the sample is clipped
  Vector x, y;  ///< derivatives with respect to what is unknown besides, if anything
};

template <std::size_t count>
HWY_INLINE void add(const Samples& s, Vector (&part)[count]) {
  const Vector by_profile = hn::Mul(s.weight, s.profile), by_slope = hn::Mul(s.weight, s.slope);
  part[pp] = hn::MulAdd(by_profile, s.profile, part[pp]);
  part[p1] = hn::Add(part[p1], by_profile);
  part[n1] = hn::Add(part[n1], s.weight);
  part[ps] = hn::MulAdd(by_profile, s.slope, part[ps]);
  part[s1] = hn::Add(part[s1], by_slope);
  part[ss] = hn::MulAdd(by_slope, s.slope, part[ss]);
  part[rp] = hn::MulAdd(s.pull, s.profile, part[rp]);
  part[r1] = hn::Add(part[r1], s.pull);
  part[rs] = hn::MulAdd(s.pull, s.slope, part[rs]);
  part[rr] = hn::MulAdd(s.pull, s.residual, part[rr]);
  if constexpr (count > px) {
    const Vector by_x = hn::Mul(s.weight, s.x);
    part[px] = hn::MulAdd(by_profile, s.x, part[px]);
    part[x1] = hn::Add(part[x1], by_x);
    part[sx] = hn::MulAdd(by_slope, s.x, part[sx]);
    part[xx] = hn::MulAdd(by_x, s.x, part[xx]);
    part[rx] = hn::MulAdd(s.pull, s.x, part[rx]);
  }
  if constexpr (count > py) {
    const Vector by_y = hn::Mul(s.weight, s.y);
    part[py] = hn::MulAdd(by_profile, s.y, part[py]);
    part[y1] = hn::Add(part[y1], by_y);
    part[sy] = hn::MulAdd(by_slope, s.y, part[sy]);
    part[xy] = hn::MulAdd(by_y, s.x, part[xy]);
    part[yy] = hn::MulAdd(by_y, s.y, part[yy]);
    part[ry] = hn::MulAdd(s.pull, s.y, part[ry]);
  }
}

/// Makes clipped samples say "at least the ceiling": weight and pull are second and first derivative of log Phi(z).
/// \param excess  of the model over the ceiling
HWY_INLINE void censor(Mask clipped, Vector excess, Vector precision, Samples& samples) {
  const Floats d;
  const Integers integers;
  samples.weight = hn::IfThenZeroElse(clipped, samples.weight);
  samples.pull = hn::IfThenZeroElse(clipped, samples.pull);
  samples.residual = hn::IfThenZeroElse(clipped, samples.residual);
  const Vector root = hn::Sqrt(precision), z = hn::Mul(excess, root);
  const Vector lowest = hn::Set(d, MillsRatio::lowest), highest = hn::Set(d, MillsRatio::highest);
  // Beyond that it had to be clipped and tells nothing.
  const Mask told = hn::And(clipped, hn::Lt(z, highest));
  if (hn::AllFalse(d, told)) return;
  const Vector within = hn::Min(hn::Max(z, lowest), highest);
  const Vector steps = hn::Set(d, MillsRatio::steps), half = hn::Set(d, 0.5F);
  const auto index = hn::ConvertTo(integers, hn::MulAdd(hn::Sub(within, lowest), steps, half));
  const Vector node = hn::Add(hn::Mul(hn::ConvertTo(d, index), hn::Set(d, 1 / MillsRatio::steps)), lowest);
  const Vector at_node = hn::GatherIndex(d, MillsRatio::inverse(), index);
  // The ratio's derivative is -ratio (ratio + z).
  const Vector bend = hn::Mul(at_node, hn::Add(at_node, node));
  const Vector ratio = hn::NegMulAdd(hn::Sub(within, node), bend, at_node);
  const Vector weight = hn::Mul(hn::Mul(ratio, hn::Add(ratio, within)), precision);
  // Below the table the ratio is -z, nearly.
  const Vector pull = hn::Mul(hn::Add(ratio, hn::Max(hn::Sub(lowest, z), hn::Zero(d))), root);
  samples.weight = hn::IfThenElse(told, weight, samples.weight);
  samples.pull = hn::IfThenElse(told, pull, samples.pull);
}

/// One bell while its samples are summed.
/// \tparam is_even         no sample was exposed later than its frame
/// \tparam extra_columns   0; 1: the width is unknown, too; 2: a curved background is
/// \tparam may_be_clipped  samples may be +infinity
template <bool is_even, int extra_columns, bool may_be_clipped>
class Line {
 public:
  Line(const BellBatch& batch, const Places& places, std::size_t i)
      : table_(*batch.table[i]),
        row_(places.entry(i, table_)),
        gray_(batch.gray[i] + places.first(i, batch)),
        present_(batch.present[i] + places.first(i, batch)),
        sample_late_(is_even ? nullptr : batch.late[i] + places.first(i, batch)),
        amplitude_(hn::Set(Floats(), batch.amplitude[i])),
        background_(hn::Set(Floats(), batch.background[i])),
        // A little later than the row's bell, and a little wider: the profile is a little further back on its slope.
        late_(hn::Set(Floats(), batch.time[i] - places.time[i])),
        wider_(hn::Set(Floats(), batch.width_rest[i])),
        first_after_(static_cast<float>(-table_.reach) - places.phase[i]) {
    if constexpr (extra_columns == 2) {
      const Floats d;
      tilt_ = hn::Set(d, batch.tilt[i]), bend_ = hn::Set(d, batch.bend[i]);
      per_core_ = hn::Set(d, 1 / batch.core[i]);
      // Which samples belong to the core is told by where the bell was at first.
      core_late_ = hn::Set(d, batch.core_time[i] - places.time[i]);
      core_ = hn::Set(d, batch.core[i]);
    }
  }

  template <std::size_t count>
  HWY_INLINE void sum(const BellBatch& batch, Vector (&part)[count]) const {
    const Floats d;
    const auto lanes = static_cast<int>(hn::Lanes(d));
    for (Vector& total : part) total = hn::Zero(d);
    for (int k = 0; k < table_.length; k += lanes) add(samples_at(batch, k), part);
  }

 private:
  HWY_INLINE Samples samples_at(const BellBatch& batch, int k) const {
    const Floats d;
    Samples s;
    const Vector gray = hn::LoadU(d, gray_ + k);
    const Vector row_after = hn::Iota(d, first_after_ + static_cast<float>(k));  // the row's bell
    Vector after = hn::Sub(row_after, late_);
    s.slope = hn::LoadU(d, &table_.slope[row_ + static_cast<std::size_t>(k)]);
    const Vector back = hn::MulAdd(wider_, row_after, late_);
    if constexpr (is_even) {
      s.profile = hn::NegMulAdd(back, s.slope, hn::LoadU(d, &table_.value[row_ + static_cast<std::size_t>(k)]));
    } else {
      const Vector sample_late = hn::LoadU(d, sample_late_ + k);
      const Shifted shifted = shift(table_, row_ + static_cast<std::size_t>(k), s.slope, hn::Sub(sample_late, back));
      s.profile = shifted.profile, s.slope = shifted.slope;
      after = hn::Add(after, sample_late);
    }
    Vector use = hn::Mul(hn::LoadU(d, present_ + k), hn::LoadU(d, &table_.inside[static_cast<std::size_t>(k)]));
    Vector model = hn::MulAdd(amplitude_, s.profile, background_);
    if constexpr (extra_columns == 1) s.x = hn::Mul(s.slope, after);
    if constexpr (extra_columns == 2) {
      s.x = hn::Mul(after, per_core_), s.y = hn::Mul(s.x, s.x);
      model = hn::Add(model, hn::Mul(s.x, hn::MulAdd(s.x, bend_, tilt_)));
      use = hn::IfThenElseZero(hn::Le(hn::Abs(hn::Sub(row_after, core_late_)), core_), use);
    }
    const Vector variance =
        hn::MulAdd(hn::Set(d, batch.gain), hn::Max(model, hn::Zero(d)), hn::Set(d, batch.read_variance));
    s.weight = hn::Div(use, variance);
    s.residual = hn::Sub(gray, model);
    s.pull = hn::Mul(s.weight, s.residual);
    if constexpr (may_be_clipped) {
      const Mask clipped = hn::IsInf(gray);
      if (!hn::AllFalse(d, clipped)) censor(clipped, hn::Sub(model, hn::Set(d, batch.ceiling)), s.weight, s);
    }
    return s;
  }

  const BellTable& table_;
  std::size_t row_;
  const float *gray_, *present_, *sample_late_;
  Vector amplitude_, background_, late_, wider_;
  float first_after_;  ///< [frames] after the row's bell of its first sample
  Vector tilt_, bend_, per_core_, core_late_, core_;
};

template <bool is_even, int extra_columns, bool may_be_clipped>
void weigh_with(const BellBatch& batch, Equations& equations) {
  constexpr int count = sums_of(extra_columns);
  Sums<count> sums;
  Places places;
  find_places(batch, places);
  for (int bell = 0; bell < batch.count; ++bell) {
    const auto i = static_cast<std::size_t>(bell);
    if (!is_open(batch, i)) continue;
    Vector part[count];
    Line<is_even, extra_columns, may_be_clipped>(batch, places, i).sum(batch, part);
    sums.put(bell, part);
  }
  for (int s = 0; s < count; ++s) sums.total(s, equations.of[s]);
}

/// The equations of the bells that still move. Backgrounds are curved for bells alone whose samples are even.
template <int extra_columns>
void weigh(const BellBatch& batch, Equations& equations) {
  const bool is_even = !batch.late[0];
  if constexpr (extra_columns == 0)
    if (!batch.may_be_clipped)
      return is_even ? weigh_with<true, 0, false>(batch, equations) : weigh_with<false, 0, false>(batch, equations);
  if constexpr (extra_columns == 2)
    weigh_with<true, 2, true>(batch, equations);
  else
    is_even ? weigh_with<true, extra_columns, true>(batch, equations)
            : weigh_with<false, extra_columns, true>(batch, equations);
}

/// Whether steps are so small that bells have arrived. What a step leaves is its square over the stripe's width. What
/// clipped samples tell bends more, and their residuals are those before the step.
/// \param sigma, spread      standard deviations of time and amplitude
/// \param step, by_amplitude the changes of both
Mask are_small(const BellBatch& batch, Vector step, Vector sigma, Vector by_amplitude, Vector amplitude,
               Vector spread) {
  constexpr float small = 0.02F;  // change of the amplitude that changes no weight
  constexpr float hardly = 0.3F;  // [standard deviations]
  const Floats d;
  const Vector change = hn::Abs(by_amplitude);
  const Mask small_step = hn::Lt(hn::Mul(step, step), hn::Mul(hn::Set(d, batch.curvature), sigma));
  const Mask are = hn::And(small_step, hn::Lt(change, hn::Mul(hn::Set(d, small), amplitude)));
  if (!batch.may_be_clipped) return are;
  const Vector share = hn::Set(d, hardly);
  return hn::And(are, hn::And(hn::Lt(hn::Abs(step), hn::Mul(share, sigma)), hn::Lt(change, hn::Mul(share, spread))));
}

/// Applies the change that the equations of some bells tell. \return whether all of them that are good have arrived
/// \param may_arrive  whether this can be the last step
bool take_step(const Equations& e, BellBatch& batch, std::size_t i, bool may_arrive) {
  const Floats d;
  const auto at = [i](const Each& values) { return hn::Load(Floats(), &values[i]); };
  const auto sum = [&](Sum which) { return at(e.of[which]); };
  const Mask open = open_bells(batch, i);
  const Vector p = sum(rp), b = sum(r1), s = sum(rs);
  // The inverse of a symmetric matrix by its cofactors, over the determinant.
  const auto minor = [&](Sum k, Sum l, Sum m, Sum n) {
    return hn::Sub(hn::Mul(sum(k), sum(l)), hn::Mul(sum(m), sum(n)));
  };
  const auto dot = [](Vector a, Vector x, Vector c, Vector y, Vector f, Vector z) {
    return hn::MulAdd(a, x, hn::MulAdd(c, y, hn::Mul(f, z)));
  };
  const Vector aa = minor(n1, ss, s1, s1), ab = minor(ps, s1, p1, ss), as = minor(p1, s1, n1, ps);
  const Vector bb = minor(pp, ss, ps, ps), bs = minor(p1, ps, pp, s1), slopes = minor(pp, n1, p1, p1);
  const Vector determinant = dot(sum(pp), aa, sum(p1), ab, sum(ps), as);
  const Vector inverse = hn::Div(hn::Set(d, 1.0F), determinant);
  const Vector by_amplitude = hn::Mul(dot(aa, p, ab, b, as, s), inverse);
  const Vector by_background = hn::Mul(dot(ab, p, bb, b, bs, s), inverse);
  const Vector by_slope = hn::Mul(dot(as, p, bs, b, slopes, s), inverse);
  const Vector amplitude = at(batch.amplitude);
  const Vector step = clamped(hn::Neg(hn::Div(by_slope, amplitude)), batch.longest_step);
  const Vector next = hn::Max(hn::Add(amplitude, by_amplitude), hn::Mul(hn::Set(d, 0.3F), amplitude));
  const Vector sigma = hn::Div(hn::Sqrt(hn::Mul(slopes, inverse)), amplitude);
  const Vector explained = dot(by_amplitude, p, by_background, b, by_slope, s);
  keep(open, sigma, batch.sigma, i);
  keep(open, batch.may_be_clipped ? sum(rr) : hn::Sub(sum(rr), explained), batch.chi_square, i);
  const Mask good = hn::And(open, hn::Gt(determinant, hn::Zero(d)));
  keep(good, next, batch.amplitude, i);
  keep(good, hn::Add(at(batch.background), by_background), batch.background, i);
  const Vector time = hn::Add(at(batch.time), step);
  const Mask near = hn::And(good, hn::Le(hn::Abs(time), hn::Set(d, batch.most_moved)));
  keep(open, hn::IfThenElseZero(near, time), batch.time, i);
  keep(open, hn::IfThenElseZero(near, hn::Set(d, 1.0F)), batch.good, i);
  keep(hn::AndNot(near, good), time, batch.left_to, i);
  if (!may_arrive) return false;
  const Vector spread = hn::Sqrt(hn::Mul(aa, inverse));
  const Mask arrived = hn::And(near, are_small(batch, step, sigma, by_amplitude, next, spread));
  keep(arrived, hn::Set(d, 1.0F), batch.arrived, i);
  return hn::AllFalse(d, hn::AndNot(arrived, near));
}

/// Bells that have not arrived are good no longer.
void give_up(BellBatch& batch) {
  const Floats d;
  for_bells([&](std::size_t i) {
    hn::Store(hn::Mul(hn::Load(d, &batch.good[i]), hn::Load(d, &batch.arrived[i])), d, &batch.good[i]);
  });
}

constexpr int most_refining_steps = 12;

void Refine(BellBatch& batch) {
  Equations e;
  bool is_done = false;
  batch.arrived.fill(0);
  for (int step = 0; step < most_refining_steps && !is_done; ++step) {
    weigh<0>(batch, e);
    is_done = true;
    for_bells([&](std::size_t i) { is_done = take_step(e, batch, i, step + 1 >= batch.least_steps) && is_done; });
  }
  give_up(batch);
}

/// Solves the normal equations of one bell by elimination. \return whether they can be solved; the last pivot is then
/// 1 / variance of the last unknown
template <int count, class Number>
bool solve(Number (&a)[count][count + 1], Number (&change)[count]) {
  for (int k = 0; k < count; ++k) {
    if (!(a[k][k] > 0)) return false;
    for (int r = k + 1; r < count; ++r) {
      const Number factor = a[r][k] / a[k][k];
      for (int c = k; c <= count; ++c) a[r][c] -= factor * a[k][c];
    }
  }
  for (int k = count - 1; k >= 0; --k) {
    change[k] = a[k][count];
    for (int c = k + 1; c < count; ++c) change[k] -= a[k][c] * change[c];
    change[k] /= a[k][k];
  }
  return true;
}

/// Moves a bell by a step in time. \return whether it is still near; if not, it is good no longer
bool move_one(BellBatch& batch, std::size_t i, float amplitude_change, float background_change, float step) {
  batch.amplitude[i] = std::max(batch.amplitude[i] + amplitude_change, 0.3F * batch.amplitude[i]);
  batch.background[i] += background_change;
  batch.time[i] += std::clamp(step, -batch.longest_step, batch.longest_step);
  if (std::abs(batch.time[i]) <= batch.most_moved) return true;
  batch.good[i] = batch.time[i] = 0;
  return false;
}

/// One bell's step in all four unknowns. \return whether it has arrived
bool take_step_of_width(const Equations& equations, BellBatch& batch, std::size_t i) {
  const auto e = [&](Sum which) { return equations.of[which][i]; };
  const float amplitude = batch.amplitude[i];
  // What is known of the log width beforehand, in terms of the fourth unknown, which is -amplitude times its change.
  const float prior = batch.width_prior / (amplitude * amplitude);
  float a[4][5] = {{e(pp), e(p1), e(ps), e(px), e(rp)},
                   {e(p1), e(n1), e(s1), e(x1), e(r1)},
                   {e(ps), e(s1), e(ss), e(sx), e(rs)},
                   {e(px), e(x1), e(sx), e(xx) + prior, e(rx) + prior * amplitude * batch.log_width[i]}};
  float change[4];
  if (!solve(a, change)) return batch.good[i] = 0, false;
  const float explained = change[0] * e(rp) + change[1] * e(r1) + change[2] * e(rs) + change[3] * e(rx);
  batch.chi_square[i] = batch.may_be_clipped ? e(rr) : e(rr) - explained;
  batch.width_sigma[i] = 1 / (std::sqrt(a[3][3]) * amplitude);
  if (!move_one(batch, i, change[0], change[1], -change[2] / amplitude)) return false;
  const float before = batch.log_width[i], wider = std::clamp(-change[3] / amplitude, -0.3F, 0.3F);
  batch.log_width[i] = std::clamp(before + wider, -batch.widest, batch.widest);
  batch.table[i] = &batch.tables->at(static_cast<double>(batch.log_width[i]));
  batch.width_rest[i] = batch.log_width[i] - batch.table[i]->log_width;
  const float moved = batch.log_width[i] - before;
  return moved * moved < 0.01F * batch.width_sigma[i] && std::abs(change[0]) < 0.02F * batch.amplitude[i];
}

/// One bell's step in amplitude, time and a curved background. \return whether it has arrived
bool take_step_on_curved(const Equations& equations, BellBatch& batch, std::size_t i) {
  const auto e = [&](Sum which) { return static_cast<double>(equations.of[which][i]); };
  double a[5][6] = {{e(pp), e(p1), e(px), e(py), e(ps), e(rp)},
                    {e(p1), e(n1), e(x1), e(y1), e(s1), e(r1)},
                    {e(px), e(x1), e(xx), e(xy), e(sx), e(rx)},
                    {e(py), e(y1), e(xy), e(yy), e(sy), e(ry)},
                    {e(ps), e(s1), e(sx), e(sy), e(ss), e(rs)}};
  double change[5];
  if (!solve(a, change)) return batch.good[i] = 0, false;
  const double amplitude = static_cast<double>(batch.amplitude[i]), step = -change[4] / amplitude;
  const double sigma = 1 / (std::sqrt(a[4][4]) * amplitude);
  batch.sigma[i] = static_cast<float>(sigma);
  batch.chi_square[i] = static_cast<float>(e(rr));
  batch.tilt[i] += static_cast<float>(change[2]);
  batch.bend[i] += static_cast<float>(change[3]);
  if (!move_one(batch, i, static_cast<float>(change[0]), static_cast<float>(change[1]), static_cast<float>(step)))
    return false;
  return std::abs(step) < 0.1 * sigma && std::abs(change[0]) < 0.02 * amplitude;
}

/// Steps of bells that are solved for one by one.
template <int extra_columns, class Step>
void refine_each(BellBatch& batch, const Step& take_step_of) {
  Equations e;
  batch.arrived.fill(0);
  bool is_done = false;
  for (int step = 0; step < most_refining_steps && !is_done; ++step) {
    weigh<extra_columns>(batch, e);
    is_done = true;
    for (std::size_t i = 0; i < static_cast<std::size_t>(batch.count); ++i) {
      if (!is_open(batch, i)) continue;
      batch.arrived[i] = take_step_of(e, batch, i) ? 1.0F : 0.0F;
      if (is_open(batch, i)) is_done = false;
    }
  }
  give_up(batch);
}

void RefineWidths(BellBatch& batch) { refine_each<1>(batch, take_step_of_width); }
void RefineOnCurved(BellBatch& batch) { refine_each<2>(batch, take_step_on_curved); }

}  // namespace pagesweep::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pagesweep {

HWY_EXPORT(Approach);
HWY_EXPORT(Refine);
HWY_EXPORT(RefineWidths);
HWY_EXPORT(RefineOnCurved);

void approach(BellBatch& batch) { HWY_DYNAMIC_DISPATCH(Approach)(batch); }
void refine(BellBatch& batch) { HWY_DYNAMIC_DISPATCH(Refine)(batch); }
void refine_widths(BellBatch& batch) { HWY_DYNAMIC_DISPATCH(RefineWidths)(batch); }
void refine_on_curved(BellBatch& batch) { HWY_DYNAMIC_DISPATCH(RefineOnCurved)(batch); }

}  // namespace pagesweep
#endif
