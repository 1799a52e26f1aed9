// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <optional>

#include "pagesweep/data/time_map.h"
#include "pagesweep/timing/pixel_window_internal.h"
#include "pagesweep/timing/plain_bells_internal.h"

namespace pagesweep {

/// What an estimator says about one pixel.
struct PixelTime {
  double time = 0;        ///< [frames]
  double sigma = 0;       ///< [frames]
  double amplitude = 0;   ///< [gray values]
  double residual = 0;    ///< rms over the noise expected
  double background = 0;  ///< [gray values]
  double bell_time = 0;   ///< [frames] where the bell was found, whatever the status
  PixelStatus status = PixelStatus::too_dark;
};

/// Puts it into the map: time and sigma only if it is ok.
inline void set_time(TimeMap& map, int x, int y, const PixelTime& time) {
  const bool ok = time.status == PixelStatus::ok;
  map.status(x, y) = time.status;
  map.amplitude(x, y) = static_cast<float>(time.amplitude);
  map.residual(x, y) = static_cast<float>(time.residual);
  map.time(x, y) = ok ? static_cast<float>(time.time) : not_a_number;
  map.sigma(x, y) = ok ? static_cast<float>(time.sigma) : not_a_number;
}

/// All that is the same for every pixel of a camera.
struct PixelJudge {
  const StripeProfile& profile;
  FrameNoise noise;
  int frame_count = 0;
  double min_amplitude = 0;    ///< [gray values]
  double max_sigma = 0.5;      ///< [frames]
  bool refuse_misfits = true;  ///< bells that do not fit are corrected or refused
};

/// Centre of mass of what rises above a fifth of the bell's height, background removed. Clipped samples count as the
/// ceiling.
PixelTime time_by_center_of_mass(const PixelWindow& window, const PixelJudge& judge);

/// Eq. 8-10 against the profile sampled at whole frames.
PixelTime time_by_shift(const PixelWindow& window, const PixelJudge& judge);

/// Maximum likelihood against the smooth profile, see fit_bell(). Where the residuals are more than noise, light from
/// elsewhere may have a part in it (a facing page, gloss): then the bell's core alone on a curved background gives a
/// second opinion, and replaces the first where the two contradict each other (Hausman 1978: an efficient estimate is
/// doubted when a robust one differs by more than the difference of their variances allows).
PixelTime time_by_likelihood(const PixelWindow& window, const PixelJudge& judge);

/// The same, from the window around a frame. A start value that was far off had the bell near its window's border: then
/// once more, with the bell in the middle.
/// \param window_around  gives the PixelWindow around a frame
template <class WindowAround>
PixelTime time_by_likelihood_around(int frame, const WindowAround& window_around, const PixelJudge& judge) {
  const PixelTime time = time_by_likelihood(window_around(frame), judge);
  if (std::abs(time.bell_time - frame) <= 0.25 * judge.profile.full_width_half_maximum() + 1) return time;
  const double within = std::clamp(time.bell_time, 0.0, judge.frame_count - 1.0);
  return time_by_likelihood(window_around(static_cast<int>(std::lround(within))), judge);
}

/// What time_by_likelihood() says of a bell that was fitted as a plain one; nothing if it is not one, because its
/// residuals are more than noise.
std::optional<PixelTime> time_of_plain_bell(const PlainBells::Fit& fit, double width, const PixelJudge& judge);

/// What time_of_plain_bell() says of bells of which no sample is missing, side by side.
struct BellVerdicts {
  BellBatch::Each<float> residual;        ///< rms over the noise expected
  BellBatch::Each<std::int32_t> is_told;  ///< 0: there is more to say than what is here
  BellBatch::Each<std::int32_t> is_dark;
};
void judge_whole_bells(const BellBatch& batch, const PixelJudge& judge, BellVerdicts& verdicts);

/// What the samples say about a bell, whichever estimator found it: ok, or too_dark, truncated, saturated, bad_fit.
/// A bell that five standard deviations of noise could have made is too dark, and so is one whose time is too
/// uncertain. Each flank must have been recorded for the most part and be represented by samples that are neither
/// clipped nor dropped; samples around the middle must follow the profile to within a few percent of the height.
PixelStatus judge_bell(const PixelWindow& window, const Bell& bell, double sigma, const PixelJudge& judge);

/// Where a plain bell lies in its table and its samples.
struct BellPlace {
  const BellTable* table;
  int row;
  double rest;           ///< [frames] by which it is later than the row's bell
  int first_frame;       ///< of the row's first entry
  const float* present;  ///< for each entry of the row 1, or 0 where there is no sample
  const float* gray;     ///< for each the sample; +infinity: clipped
};

/// The same of a plain bell of which samples are missing or clipped, and whose chi square is no more than noise.
PixelStatus judge_partial_bell(const PlainBells::Fit& fit, double sigma, const BellPlace& place, double width,
                               const PixelJudge& judge);

/// What time_by_likelihood() says of a plain bell whose residuals are more than noise.
/// \param second    its core's fit on a curved background
/// \param place_of  gives the BellPlace of a bell at a moment
PixelTime time_of_doubtful_bell(const PlainBells::Fit& first, const PlainBells::Fit& second,
                                const std::function<BellPlace(double time)>& place_of, double width,
                                const PixelJudge& judge);

}  // namespace pagesweep
