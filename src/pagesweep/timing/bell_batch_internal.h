// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "pagesweep/timing/bell_tables_internal.h"

namespace pagesweep {

inline constexpr int most_bells = 16;  ///< at once; the longest vector

/// Bells of some pixels while they are fitted, one entry a pixel. Times are relative to the pixel's middle frame.
struct BellBatch {
  template <class T>
  using Each = std::array<T, most_bells>;

  int count = 0;
  int middle = 0;          ///< entry of gray[i] that is of the middle frame
  float most_moved = 0;    ///< [frames] from there: farther away samples are missing
  float near = 0;          ///< [frames] from the true time: small against the stripe's width
  float longest_step = 0;  ///< [frames]
  float curvature = 0;     ///< [frames] a step whose square is below this times sigma leaves little of sigma
  int least_steps = 1;     ///< of refine(): the weights of the first are those of where it starts
  float read_variance = 1, gain = 0;
  float ceiling = 0;            ///< [gray values] samples are clipped from here on
  bool may_be_clipped = false;  ///< whether any sample is

  Each<const BellTable*> table{};
  Each<float> width_rest{};      ///< log width beyond the table's
  Each<const float*> gray{};     ///< samples; +infinity where one is clipped
  Each<const float*> present{};  ///< for each of them 1, or 0 if it is to be passed over
  Each<const float*> late{};     ///< for each of them [frames] by which it was exposed later; all null: not at all

  alignas(64) Each<float> time{}, amplitude{}, background{}, sigma{}, chi_square{};
  alignas(64) Each<float> good{};  ///< 1, or 0; 0 from `count` on
  alignas(64) Each<float> arrived{};
  alignas(64) Each<float> left_to{};  ///< of a bell that refine() finds to be no good: where it left for, 0 if nowhere

  // For refine_on_curved() alone.
  Each<float> core{};          ///< [frames] to both sides of core_time that belong to the bell's core
  Each<float> core_time{};     ///< where the bell was at first
  Each<float> tilt{}, bend{};  ///< background + x tilt + x^2 bend, x from -1 to 1 over the core

  // For refine_widths() alone.
  const BellTables* tables = nullptr;
  float width_prior = 0;      ///< 1 / variance of the log width as it is known beforehand, around 0
  float widest = 0;           ///< log width that no bell exceeds, to either side
  Each<float> log_width{};    ///< where it starts and what comes out
  Each<float> width_sigma{};  ///< of the log width
};

/// Least squares steps with even weights until all good bells are near; what goes astray is good no longer.
/// \pre all samples are present, and none is clipped
void approach(BellBatch& batch);

/// Gauss-Newton steps with every sample weighted by the noise expected there, until they are small against sigma.
/// Amplitude, background and time are where they start.
void refine(BellBatch& batch);

/// The same with the width as a fourth unknown. Changes the tables with it.
/// \pre the tables cover all widths
void refine_widths(BellBatch& batch);

/// The same with tilt and bend of the background as fourth and fifth unknown, from the bells' cores alone.
void refine_on_curved(BellBatch& batch);

}  // namespace pagesweep
