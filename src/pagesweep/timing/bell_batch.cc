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
using Vector = hn::Vec<Floats>;
using Each = BellBatch::Each<float>;

/// Partial sums of `Count` quantities for every bell, a vector each, and their totals.
template <int Count>
class Sums {
 public:
  void put(int bell, const Vector (&sums)[Count]) {
    for (int s = 0; s < Count; ++s) hn::Store(sums[s], Floats(), row(s, bell));
  }
  /// Of quantity s, for every bell.
  void total(int s, Each& totals) {
    const int lanes = static_cast<int>(hn::Lanes(Floats()));
    for (int first = 0; first < most_bells; first += lanes)
      hn::StoreU(total_of(row(s, first), lanes), Floats(), &totals[static_cast<std::size_t>(first)]);
  }

 private:
  float* row(int s, int bell) { return partial_ + (s * most_bells + bell) * static_cast<int>(hn::Lanes(Floats())); }

  /// Sums of as many vectors as they have lanes, one a lane. Each pass halves their number.
  static Vector total_of(float* rows, int lanes) {
    const Floats d;
#if HWY_TARGET == HWY_SCALAR
    (void)lanes;
#else
    for (int left = lanes; left > 1; left /= 2)
      for (int k = 0; k < left / 2; ++k) {
        const Vector a = hn::Load(d, rows + 2 * k * lanes), b = hn::Load(d, rows + (2 * k + 1) * lanes);
        hn::Store(hn::Add(hn::ConcatEven(d, b, a), hn::ConcatOdd(d, b, a)), d, rows + k * lanes);
      }
#endif
    return hn::Load(d, rows);
  }

  HWY_ALIGN float partial_[Count * most_bells * most_bells];
};

/// Where a bell lies in its table and its samples.
struct Place {
  const BellTable* table;
  std::size_t row;       ///< first entry of the table's row
  std::ptrdiff_t first;  ///< entry of the row's first sample
  float time;            ///< [frames] of a bell exactly on the row
  float phase;           ///< [frames] of the row
};

Place place_of(const BellBatch& batch, std::size_t i) {
  const BellTable* table = batch.table[i];
  const float whole = std::floor(batch.time[i] + 0.5f);
  const int row = static_cast<int>((batch.time[i] - whole + 0.5f) * BellTable::phases + 0.5f);
  const auto phase = static_cast<float>(BellTable::phase_of(row));
  return {table, static_cast<std::size_t>(row * table->length), batch.middle + static_cast<int>(whole) - table->reach,
          whole + phase, phase};
}

void Approach(BellBatch& batch) {
  constexpr int most_steps = 6;
  const Floats d;
  const auto lanes = static_cast<int>(hn::Lanes(d));
  Each amplitude, slope, on_row;
  Sums<3> sums;
  bool is_near = false;
  for (int step = 0; step < most_steps && !is_near; ++step) {
    for (int i = 0; i < batch.count; ++i) {
      const Place place = place_of(batch, static_cast<std::size_t>(i));
      const BellTable& table = *place.table;
      const float* gray_row = batch.gray[static_cast<std::size_t>(i)] + place.first;
      Vector part[3] = {hn::Zero(d), hn::Zero(d), hn::Zero(d)};
      for (int k = 0; k < table.length; k += lanes) {
        const Vector gray = hn::LoadU(d, gray_row + k);
        const std::size_t at = place.row + static_cast<std::size_t>(k);
        part[0] = hn::MulAdd(hn::LoadU(d, &table.amplitude_weight[at]), gray, part[0]);
        part[1] = hn::MulAdd(hn::LoadU(d, &table.background_weight[at]), gray, part[1]);
        part[2] = hn::MulAdd(hn::LoadU(d, &table.slope_weight[at]), gray, part[2]);
      }
      sums.put(i, part);
      on_row[static_cast<std::size_t>(i)] = place.time;
    }
    sums.total(0, amplitude);
    sums.total(1, batch.background);
    sums.total(2, slope);
    is_near = step > 0;
    for (std::size_t i = 0; i < static_cast<std::size_t>(batch.count); ++i) {
      // A bell that is late by x has the slope -amplitude x in it.
      const float late = -slope[i] / amplitude[i];
      const float time = on_row[i] + std::clamp(late, -batch.longest_step, batch.longest_step);
      batch.good[i] = batch.good[i] && amplitude[i] > 0 && std::abs(time) <= batch.most_moved;
      if (batch.good[i] && !(std::abs(time - batch.time[i]) < batch.near)) is_near = false;
      batch.time[i] = batch.good[i] ? time : 0;
      batch.amplitude[i] = amplitude[i];
    }
  }
}

/// The normal equations of a Gauss-Newton step for amplitude, background and slope.
struct Equations {
  Each pp, p1, n1, ps, s1, ss, rp, r1, rs, rr;
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

/// \tparam is_even  no sample was exposed later than its frame
template <bool is_even>
void weigh(const BellBatch& batch, Equations& equations) {
  const Floats d;
  const auto lanes = static_cast<int>(hn::Lanes(d));
  const Vector read = hn::Set(d, batch.read_variance), gain = hn::Set(d, batch.gain);
  Sums<10> sums;
  for (int i = 0; i < batch.count; ++i) {
    const auto bell = static_cast<std::size_t>(i);
    const Place place = place_of(batch, bell);
    const BellTable& table = *place.table;
    const Vector amplitude = hn::Set(d, batch.amplitude[bell]), background = hn::Set(d, batch.background[bell]);
    // A little later than the row's bell, and a little wider: the profile is a little further back on its slope.
    const Vector late = hn::Set(d, batch.time[bell] - place.time), wider = hn::Set(d, batch.width_rest[bell]);
    const auto first = static_cast<float>(-table.reach);
    const float* gray_row = batch.gray[bell] + place.first;
    const float* present = batch.present[bell] + place.first;
    Vector after = hn::Iota(d, first - place.phase);
    Vector part[10];
    for (Vector& sum : part) sum = hn::Zero(d);
    for (int k = 0; k < table.length; k += lanes) {
      const std::size_t at = place.row + static_cast<std::size_t>(k);
      const Vector gray = hn::LoadU(d, gray_row + k);
      Vector slope = hn::LoadU(d, &table.slope[at]), profile;
      if constexpr (is_even) {
        profile = hn::NegMulAdd(hn::MulAdd(wider, after, late), slope, hn::LoadU(d, &table.value[at]));
      } else {
        const Vector sample_late = hn::LoadU(d, batch.late[bell] + place.first + k);
        const Shifted shifted = shift(table, at, slope, hn::Sub(sample_late, hn::MulAdd(wider, after, late)));
        profile = shifted.profile, slope = shifted.slope;
      }
      const Vector model = hn::MulAdd(amplitude, profile, background);
      const Vector variance = hn::MulAdd(gain, hn::Max(model, hn::Zero(d)), read);
      const Vector use = hn::Mul(hn::LoadU(d, present + k), hn::LoadU(d, &table.inside[static_cast<std::size_t>(k)]));
      const Vector weight = hn::Div(use, variance);
      const Vector residual = hn::Sub(gray, model);
      const Vector by_profile = hn::Mul(weight, profile), by_slope = hn::Mul(weight, slope);
      const Vector by_residual = hn::Mul(weight, residual);
      part[0] = hn::MulAdd(by_profile, profile, part[0]);
      part[1] = hn::Add(part[1], by_profile);
      part[2] = hn::Add(part[2], weight);
      part[3] = hn::MulAdd(by_profile, slope, part[3]);
      part[4] = hn::Add(part[4], by_slope);
      part[5] = hn::MulAdd(by_slope, slope, part[5]);
      part[6] = hn::MulAdd(by_residual, profile, part[6]);
      part[7] = hn::Add(part[7], by_residual);
      part[8] = hn::MulAdd(by_residual, slope, part[8]);
      part[9] = hn::MulAdd(by_residual, residual, part[9]);
      after = hn::Add(after, hn::Set(d, static_cast<float>(lanes)));
    }
    sums.put(i, part);
  }
  Each* const totals[] = {&equations.pp, &equations.p1, &equations.n1, &equations.ps, &equations.s1,
                          &equations.ss, &equations.rp, &equations.r1, &equations.rs, &equations.rr};
  for (int s = 0; s < 10; ++s) sums.total(s, *totals[s]);
}

void Refine(BellBatch& batch) {
  constexpr int most_steps = 12;
  constexpr float small = 0.02f;  // change of the amplitude that changes no weight
  Equations e;
  BellBatch::Each<bool> arrived{};
  bool is_done = false;
  for (int step = 0; step < most_steps && !is_done; ++step) {
    batch.late[0] ? weigh<false>(batch, e) : weigh<true>(batch, e);
    is_done = true;
    for (std::size_t i = 0; i < static_cast<std::size_t>(batch.count); ++i) {
      // The inverse of a symmetric matrix by its cofactors, over the determinant.
      const float aa = e.n1[i] * e.ss[i] - e.s1[i] * e.s1[i], ab = e.ps[i] * e.s1[i] - e.p1[i] * e.ss[i];
      const float as = e.p1[i] * e.s1[i] - e.n1[i] * e.ps[i], bb = e.pp[i] * e.ss[i] - e.ps[i] * e.ps[i];
      const float bs = e.p1[i] * e.ps[i] - e.pp[i] * e.s1[i], ss = e.pp[i] * e.n1[i] - e.p1[i] * e.p1[i];
      const float determinant = e.pp[i] * aa + e.p1[i] * ab + e.ps[i] * as;
      const float amplitude = (aa * e.rp[i] + ab * e.r1[i] + as * e.rs[i]) / determinant;
      const float background = (ab * e.rp[i] + bb * e.r1[i] + bs * e.rs[i]) / determinant;
      const float slope = (as * e.rp[i] + bs * e.r1[i] + ss * e.rs[i]) / determinant;
      const float time = std::clamp(-slope / batch.amplitude[i], -batch.longest_step, batch.longest_step);
      batch.sigma[i] = std::sqrt(ss / determinant) / batch.amplitude[i];
      batch.chi_square[i] = e.rr[i] - (amplitude * e.rp[i] + background * e.r1[i] + slope * e.rs[i]);
      batch.good[i] = batch.good[i] && determinant > 0;
      if (!batch.good[i]) continue;
      batch.amplitude[i] = std::max(batch.amplitude[i] + amplitude, 0.3F * batch.amplitude[i]);
      batch.background[i] += background;
      batch.time[i] += time;
      batch.good[i] = std::abs(batch.time[i]) <= batch.most_moved;
      // What a step leaves is its square over the stripe's width.
      arrived[i] = time * time < batch.curvature * batch.sigma[i] && std::abs(amplitude) < small * batch.amplitude[i];
      if (batch.good[i] && !arrived[i]) is_done = false;
      if (batch.good[i]) continue;
      batch.left_to[i] = batch.time[i];
      batch.time[i] = 0;
    }
  }
  for (std::size_t i = 0; i < static_cast<std::size_t>(batch.count); ++i) batch.good[i] = batch.good[i] && arrived[i];
}

}  // namespace pagesweep::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pagesweep {

HWY_EXPORT(Approach);
HWY_EXPORT(Refine);

void approach(BellBatch& batch) { HWY_DYNAMIC_DISPATCH(Approach)(batch); }
void refine(BellBatch& batch) { HWY_DYNAMIC_DISPATCH(Refine)(batch); }

}  // namespace pagesweep
#endif
