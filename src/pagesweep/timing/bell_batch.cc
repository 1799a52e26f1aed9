// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/bell_batch_internal.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

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

/// Of the good bells those that have not gone astray, at most `batch.most_moved` frames.
Mask keep_near(BellBatch& batch, std::size_t i, Mask good, Vector time) {
  const Floats d;
  const Mask near = hn::And(good, hn::Le(hn::Abs(time), hn::Set(d, batch.most_moved)));
  hn::Store(hn::IfThenElseZero(near, time), d, &batch.time[i]);
  hn::Store(hn::IfThenElseZero(near, hn::Set(d, 1.0F)), d, &batch.good[i]);
  return near;
}

Mask good_bells(const BellBatch& batch, std::size_t i) {
  return hn::Gt(hn::Load(Floats(), &batch.good[i]), hn::Zero(Floats()));
}

void Approach(BellBatch& batch) {
  constexpr int most_steps = 6;
  const Floats d;
  const auto lanes = static_cast<int>(hn::Lanes(d));
  alignas(64) Each slope;
  Places places;
  Sums<3> sums;
  bool is_near = false;
  for (int step = 0; step < most_steps && !is_near; ++step) {
    find_places(batch, places);
    for (int bell = 0; bell < batch.count; ++bell) {
      const auto i = static_cast<std::size_t>(bell);
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
    sums.total(0, batch.amplitude);
    sums.total(1, batch.background);
    sums.total(2, slope);
    is_near = step > 0;
    for_bells([&](std::size_t i) {
      // A bell that is late by x has the slope -amplitude x in it.
      const Vector amplitude = hn::Load(d, &batch.amplitude[i]);
      const Vector late = hn::Neg(hn::Div(hn::Load(d, &slope[i]), amplitude));
      const Vector time = hn::Add(hn::Load(d, &places.time[i]), clamped(late, batch.longest_step));
      const Vector moved = hn::Abs(hn::Sub(time, hn::Load(d, &batch.time[i])));
      const Mask good = hn::And(good_bells(batch, i), hn::Gt(amplitude, hn::Zero(d)));
      const Mask near = keep_near(batch, i, good, time);
      is_near = is_near && hn::AllFalse(d, hn::And(near, hn::Ge(moved, hn::Set(d, batch.near))));
    });
  }
}

/// The normal equations of a Gauss-Newton step for amplitude, background and slope; then for width, which is the slope
/// times the distance from the middle.
struct Equations {
  alignas(64) Each pp, p1, n1, ps, s1, ss, rp, r1, rs, rr;
  alignas(64) Each pw, w1, sw, ww, rw;
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

/// Some samples of a bell: their weights, what the model leaves of them, and the model's derivatives.
struct Samples {
  Vector weight, residual, profile, slope;
  Vector stretch;  ///< with respect to the width, if that is unknown, too
};

template <std::size_t count>
HWY_INLINE void add(const Samples& s, Vector (&part)[count]) {
  const Vector by_profile = hn::Mul(s.weight, s.profile), by_slope = hn::Mul(s.weight, s.slope);
  const Vector by_residual = hn::Mul(s.weight, s.residual);
  part[0] = hn::MulAdd(by_profile, s.profile, part[0]);
  part[1] = hn::Add(part[1], by_profile);
  part[2] = hn::Add(part[2], s.weight);
  part[3] = hn::MulAdd(by_profile, s.slope, part[3]);
  part[4] = hn::Add(part[4], by_slope);
  part[5] = hn::MulAdd(by_slope, s.slope, part[5]);
  part[6] = hn::MulAdd(by_residual, s.profile, part[6]);
  part[7] = hn::Add(part[7], by_residual);
  part[8] = hn::MulAdd(by_residual, s.slope, part[8]);
  part[9] = hn::MulAdd(by_residual, s.residual, part[9]);
  if constexpr (count == 15) {
    part[10] = hn::MulAdd(by_profile, s.stretch, part[10]);
    part[11] = hn::MulAdd(s.weight, s.stretch, part[11]);
    part[12] = hn::MulAdd(by_slope, s.stretch, part[12]);
    part[13] = hn::MulAdd(hn::Mul(s.weight, s.stretch), s.stretch, part[13]);
    part[14] = hn::MulAdd(by_residual, s.stretch, part[14]);
  }
}

/// \tparam is_even    no sample was exposed later than its frame
/// \tparam has_width  whether the width is unknown, too
template <bool is_even, bool has_width>
void weigh(const BellBatch& batch, Equations& equations) {
  const Floats d;
  const auto lanes = static_cast<int>(hn::Lanes(d));
  const Vector read = hn::Set(d, batch.read_variance), gain = hn::Set(d, batch.gain);
  constexpr int count = has_width ? 15 : 10;
  Sums<count> sums;
  Places places;
  find_places(batch, places);
  for (int i = 0; i < batch.count; ++i) {
    const auto bell = static_cast<std::size_t>(i);
    const BellTable& table = *batch.table[bell];
    const std::size_t row = places.entry(bell, table);
    const Vector amplitude = hn::Set(d, batch.amplitude[bell]), background = hn::Set(d, batch.background[bell]);
    // A little later than the row's bell, and a little wider: the profile is a little further back on its slope.
    const Vector late = hn::Set(d, batch.time[bell] - places.time[bell]), wider = hn::Set(d, batch.width_rest[bell]);
    const std::ptrdiff_t first = places.first(bell, batch);
    const float *gray_row = batch.gray[bell] + first, *present = batch.present[bell] + first;
    const float *value_row = &table.value[row], *slope_row = &table.slope[row], *inside = table.inside.data();
    Vector after = hn::Iota(d, static_cast<float>(-table.reach) - places.phase[bell]);
    Vector part[count];
    for (Vector& sum : part) sum = hn::Zero(d);
    for (int k = 0; k < table.length; k += lanes) {
      const Vector gray = hn::LoadU(d, gray_row + k);
      Vector slope = hn::LoadU(d, slope_row + k), profile;
      if constexpr (is_even) {
        profile = hn::NegMulAdd(hn::MulAdd(wider, after, late), slope, hn::LoadU(d, value_row + k));
      } else {
        const Vector sample_late = hn::LoadU(d, batch.late[bell] + first + k);
        const Shifted shifted = shift(table, row + static_cast<std::size_t>(k), slope,
                                      hn::Sub(sample_late, hn::MulAdd(wider, after, late)));
        profile = shifted.profile, slope = shifted.slope;
      }
      const Vector model = hn::MulAdd(amplitude, profile, background);
      const Vector variance = hn::MulAdd(gain, hn::Max(model, hn::Zero(d)), read);
      const Vector use = hn::Mul(hn::LoadU(d, present + k), hn::LoadU(d, inside + k));
      const Vector weight = hn::Div(use, variance);
      add({weight, hn::Sub(gray, model), profile, slope, hn::Mul(slope, hn::Sub(after, late))}, part);
      after = hn::Add(after, hn::Set(d, static_cast<float>(lanes)));
    }
    sums.put(i, part);
  }
  Equations& e = equations;
  Each* const totals[] = {&e.pp, &e.p1, &e.n1, &e.ps, &e.s1, &e.ss, &e.rp, &e.r1,
                          &e.rs, &e.rr, &e.pw, &e.w1, &e.sw, &e.ww, &e.rw};
  for (int s = 0; s < count; ++s) sums.total(s, *totals[s]);
}

/// Applies the change that the equations of some bells tell. \return whether all of them that are good have arrived
bool take_step(const Equations& e, BellBatch& batch, std::size_t i) {
  constexpr float small = 0.02F;  // change of the amplitude that changes no weight
  const Floats d;
  const auto at = [i](const Each& values) { return hn::Load(Floats(), &values[i]); };
  const Vector pp = at(e.pp), p1 = at(e.p1), n1 = at(e.n1), ps = at(e.ps), s1 = at(e.s1), slopes = at(e.ss);
  const Vector rp = at(e.rp), r1 = at(e.r1), rs = at(e.rs);
  // The inverse of a symmetric matrix by its cofactors, over the determinant.
  const auto minor = [](Vector a, Vector b, Vector f, Vector g) { return hn::Sub(hn::Mul(a, b), hn::Mul(f, g)); };
  const auto dot = [](Vector a, Vector x, Vector b, Vector y, Vector c, Vector z) {
    return hn::MulAdd(a, x, hn::MulAdd(b, y, hn::Mul(c, z)));
  };
  const Vector aa = minor(n1, slopes, s1, s1), ab = minor(ps, s1, p1, slopes), as = minor(p1, s1, n1, ps);
  const Vector bb = minor(pp, slopes, ps, ps), bs = minor(p1, ps, pp, s1), ss = minor(pp, n1, p1, p1);
  const Vector determinant = dot(pp, aa, p1, ab, ps, as), inverse = hn::Div(hn::Set(d, 1.0F), determinant);
  const Vector by_amplitude = hn::Mul(dot(aa, rp, ab, r1, as, rs), inverse);
  const Vector by_background = hn::Mul(dot(ab, rp, bb, r1, bs, rs), inverse);
  const Vector by_slope = hn::Mul(dot(as, rp, bs, r1, ss, rs), inverse);
  const Vector amplitude = at(batch.amplitude);
  const Vector step = clamped(hn::Neg(hn::Div(by_slope, amplitude)), batch.longest_step);
  const Vector sigma = hn::Div(hn::Sqrt(hn::Mul(ss, inverse)), amplitude);
  hn::Store(sigma, d, &batch.sigma[i]);
  hn::Store(hn::Sub(at(e.rr), dot(by_amplitude, rp, by_background, r1, by_slope, rs)), d, &batch.chi_square[i]);
  const Mask good = hn::And(good_bells(batch, i), hn::Gt(determinant, hn::Zero(d)));
  const Vector next = hn::Max(hn::Add(amplitude, by_amplitude), hn::Mul(hn::Set(d, 0.3F), amplitude));
  hn::Store(hn::IfThenElse(good, next, amplitude), d, &batch.amplitude[i]);
  hn::Store(hn::Add(at(batch.background), hn::IfThenElseZero(good, by_background)), d, &batch.background[i]);
  const Vector time = hn::Add(at(batch.time), step);
  const Mask near = keep_near(batch, i, good, time);
  hn::Store(hn::IfThenElse(hn::AndNot(near, good), time, at(batch.left_to)), d, &batch.left_to[i]);
  // What a step leaves is its square over the stripe's width.
  const Mask arrived = hn::And(hn::Lt(hn::Mul(step, step), hn::Mul(hn::Set(d, batch.curvature), sigma)),
                               hn::Lt(hn::Abs(by_amplitude), hn::Mul(hn::Set(d, small), next)));
  hn::Store(hn::IfThenElseZero(arrived, hn::Set(d, 1.0F)), d, &batch.arrived[i]);
  return hn::AllFalse(d, hn::AndNot(arrived, near));
}

void Refine(BellBatch& batch) {
  constexpr int most_steps = 12;
  const Floats d;
  Equations e;
  bool is_done = false;
  for (int step = 0; step < most_steps && !is_done; ++step) {
    batch.late[0] ? weigh<false, false>(batch, e) : weigh<true, false>(batch, e);
    is_done = true;
    for_bells([&](std::size_t i) { is_done = take_step(e, batch, i) && is_done; });
  }
  for_bells([&](std::size_t i) {
    hn::Store(hn::Mul(hn::Load(d, &batch.good[i]), hn::Load(d, &batch.arrived[i])), d, &batch.good[i]);
  });
}

/// One bell's step in all four unknowns. \return whether it has arrived
bool take_step_of_width(const Equations& e, BellBatch& batch, std::size_t i) {
  const float amplitude = batch.amplitude[i];
  // What is known of the log width beforehand, in terms of the fourth unknown, which is -amplitude times its change.
  const float prior = batch.width_prior / (amplitude * amplitude);
  float a[4][5] = {{e.pp[i], e.p1[i], e.ps[i], e.pw[i], e.rp[i]},
                   {e.p1[i], e.n1[i], e.s1[i], e.w1[i], e.r1[i]},
                   {e.ps[i], e.s1[i], e.ss[i], e.sw[i], e.rs[i]},
                   {e.pw[i], e.w1[i], e.sw[i], e.ww[i] + prior, e.rw[i] + prior * amplitude * batch.log_width[i]}};
  for (int k = 0; k < 4; ++k) {
    if (!(a[k][k] > 0)) return batch.good[i] = 0, false;
    for (int r = k + 1; r < 4; ++r) {
      const float factor = a[r][k] / a[k][k];
      for (int c = k; c < 5; ++c) a[r][c] -= factor * a[k][c];
    }
  }
  float change[4], explained = 0;
  for (int k = 3; k >= 0; --k) {
    change[k] = a[k][4];
    for (int c = k + 1; c < 4; ++c) change[k] -= a[k][c] * change[c];
    change[k] /= a[k][k];
  }
  const float residuals[4] = {e.rp[i], e.r1[i], e.rs[i], e.rw[i]};
  for (int k = 0; k < 4; ++k) explained += change[k] * residuals[k];
  batch.chi_square[i] = e.rr[i] - explained;
  batch.width_sigma[i] = 1 / (std::sqrt(a[3][3]) * amplitude);
  batch.amplitude[i] = std::max(amplitude + change[0], 0.3F * amplitude);
  batch.background[i] += change[1];
  batch.time[i] += std::clamp(-change[2] / amplitude, -batch.longest_step, batch.longest_step);
  if (!(std::abs(batch.time[i]) <= batch.most_moved)) return batch.good[i] = 0, batch.time[i] = 0, false;
  const float before = batch.log_width[i], wider = std::clamp(-change[3] / amplitude, -0.3F, 0.3F);
  batch.log_width[i] = std::clamp(before + wider, -batch.widest, batch.widest);
  batch.table[i] = &batch.tables->at(static_cast<double>(batch.log_width[i]));
  batch.width_rest[i] = batch.log_width[i] - batch.table[i]->log_width;
  const float moved = batch.log_width[i] - before;
  return moved * moved < 0.01F * batch.width_sigma[i] && std::abs(change[0]) < 0.02F * batch.amplitude[i];
}

void RefineWidths(BellBatch& batch) {
  constexpr int most_steps = 12;
  Equations e;
  BellBatch::Each<bool> arrived{};
  bool is_done = false;
  for (int step = 0; step < most_steps && !is_done; ++step) {
    batch.late[0] ? weigh<false, true>(batch, e) : weigh<true, true>(batch, e);
    is_done = true;
    for (std::size_t i = 0; i < static_cast<std::size_t>(batch.count); ++i) {
      if (batch.good[i] == 0) continue;
      arrived[i] = take_step_of_width(e, batch, i);
      if (batch.good[i] != 0 && !arrived[i]) is_done = false;
    }
  }
  for (std::size_t i = 0; i < static_cast<std::size_t>(batch.count); ++i)
    if (!arrived[i]) batch.good[i] = 0;
}

}  // namespace pagesweep::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pagesweep {

HWY_EXPORT(Approach);
HWY_EXPORT(Refine);
HWY_EXPORT(RefineWidths);

void approach(BellBatch& batch) { HWY_DYNAMIC_DISPATCH(Approach)(batch); }
void refine(BellBatch& batch) { HWY_DYNAMIC_DISPATCH(Refine)(batch); }
void refine_widths(BellBatch& batch) { HWY_DYNAMIC_DISPATCH(RefineWidths)(batch); }

}  // namespace pagesweep
#endif
