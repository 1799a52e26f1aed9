// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/pixel_time_internal.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "pagesweep/timing/sample_scans_internal.h"
#include "pagesweep/timing/shift_equations.h"

namespace pagesweep {
namespace {

constexpr double most_misfit = 0.1;  // of the height

/// How much of one flank's information about the time, the sum of squared slopes, is there.
struct Flank {
  double whole = 0;     ///< were all frames recorded and none clipped
  double recorded = 0;  ///< within the recording
  double usable = 0;    ///< neither clipped nor dropped
  double clipped = 0;
};
using Flanks = std::array<Flank, 2>;

Flanks examine_flanks(const PixelWindow& window, const Bell& bell, const PixelJudge& judge) {
  Flanks flanks;
  const int begin = static_cast<int>(std::ceil(bell.time + bell.width * judge.profile.begin()));
  const int end = static_cast<int>(std::floor(bell.time + bell.width * judge.profile.end()));
  for (int i = begin; i <= end; ++i) {
    const int at = i - window.first_frame;
    const bool is_seen = at >= 0 && at < static_cast<int>(window.gray.size());
    const double late = is_seen ? window.late_of(static_cast<std::size_t>(at)) : 0;
    const double slope = judge.profile.derivative((i + late - bell.time) / bell.width);
    Flank& flank = flanks[slope > 0 ? 0 : 1];
    const double information = slope * slope;
    flank.whole += information;
    if (i < 0 || i >= judge.frame_count) continue;
    flank.recorded += information;
    if (!is_seen) continue;
    const float gray = window.gray[static_cast<std::size_t>(at)];
    if (std::isfinite(gray)) flank.usable += information;
    if (std::isinf(gray)) flank.clipped += information;
  }
  return flanks;
}

Flanks examine_flanks(const BellPlace& place, const PixelJudge& judge) {
  const BellTable& table = *place.table;
  const float* slope = &table.slope[static_cast<std::size_t>(place.row * table.length)];
  const int count = 2 * table.reach + 1;
  const LostSlopes lost = lost_slopes(slope, place.gray, place.present, count);
  Flanks flanks;
  for (std::size_t side = 0; side < 2; ++side) {
    Flank& flank = flanks[side];
    flank.whole = flank.recorded = table.flank(static_cast<int>(side), place.row);
    flank.clipped = static_cast<double>(lost.clipped[side]);
    flank.usable = flank.whole - static_cast<double>(lost.absent[side]) - flank.clipped;
  }
  const auto take_off = [&](int begin, int end) {
    for (int k = begin; k < end; ++k) flanks[slope[k] > 0 ? 0 : 1].recorded -= static_cast<double>(slope[k] * slope[k]);
  };
  const int end =
      static_cast<int>(std::clamp<std::int64_t>(std::int64_t{judge.frame_count} - place.first_frame, 0, count));
  take_off(0, std::clamp(-place.first_frame, 0, count));
  take_off(end, count);
  return flanks;
}

/// Whether the residuals around the bell's middle exceed both three standard deviations of noise and `most` of its
/// height.
bool misfits(const PixelWindow& window, const Bell& bell, const PixelJudge& judge, double most) {
  const double reach = 0.75 * judge.profile.full_width_half_maximum();
  double squares = 0, weights = 0;
  int samples = 0;
  for (std::size_t k = 0; k < window.gray.size(); ++k) {
    const double frame = window.time_of(k);
    if (std::abs(frame - bell.time) > reach * bell.width || !std::isfinite(window.gray[k])) continue;
    const double residual = window.gray[k] - bell.gray_at(frame, judge.profile);
    const double weight = judge.noise.weight(window.first_frame + static_cast<int>(k));
    squares += weight * residual * residual;
    weights += weight;
    ++samples;
  }
  if (samples == 0) return false;
  const double misfit = std::sqrt(squares / weights);
  // Times its weight, a sample's variance is at most that of the longest exposure.
  const double variance = judge.noise.sensor().variance(bell.background + bell.amplitude) * (samples / weights);
  return misfit > 3 * std::sqrt(variance) && misfit > most * bell.amplitude;
}

/// The same from a table.
bool misfits(const BellPlace& place, const Bell& bell, const PixelJudge& judge, double most) {
  const BellTable& table = *place.table;
  const double reach = 0.75 * judge.profile.full_width_half_maximum() * bell.width;
  const auto row = static_cast<std::size_t>(place.row * table.length);
  double squares = 0;
  int samples = 0;
  for (int k = 0; k <= 2 * table.reach; ++k) {
    const double after = place.first_frame + k - bell.time;
    if (std::abs(after) > reach || place.present[k] == 0 || std::isinf(place.gray[k])) continue;
    const std::size_t at = row + static_cast<std::size_t>(k);
    const double height = static_cast<double>(table.value[at]) - place.rest * static_cast<double>(table.slope[at]);
    const double residual =
        static_cast<double>(place.gray[k]) - bell.amplitude * height - bell.background_at(place.first_frame + k);
    squares += residual * residual;
    ++samples;
  }
  if (samples == 0) return false;
  const double misfit = std::sqrt(squares / samples);
  return misfit > 3 * std::sqrt(judge.noise.sensor().variance(bell.background + bell.amplitude)) &&
         misfit > most * bell.amplitude;
}

/// Reduced chi square beyond which noise cannot be the reason any more: four standard deviations.
double noise_limit(int samples) { return 1 + 4 * std::sqrt(2.0 / std::max(1, samples - 3)); }

/// Whether it exceeds noise_limit(), without a root.
/// \param freedom  samples less unknowns
template <class Number>
bool is_beyond_noise(Number reduced_chi_square, Number freedom) {
  const Number excess = reduced_chi_square - 1;
  return excess * std::abs(excess) * freedom > 4 * 4 * 2;
}

/// Of any bell-like stripe of width 1 the sum of the squared profile.
double light_of(const PixelJudge& judge) { return 0.75 * judge.profile.full_width_half_maximum(); }

/// \param light     sum of the squared profile, weighted
/// \param variance  of the background
template <class Number>
bool is_lost_in_noise(Number amplitude, Number light, Number variance) {
  return amplitude * amplitude * light < 25 * variance;
}

bool is_lost_in_noise(const Bell& bell, const PixelJudge& judge) {
  const double light = light_of(judge) * bell.width * judge.noise.mean_weight();
  return bell.amplitude < 0 || is_lost_in_noise(bell.amplitude, light, judge.noise.sensor().variance(bell.background));
}

double least_amplitude(const PixelJudge& judge) {
  return std::max(judge.min_amplitude, 3.0);  // [gray values] below that, rounding makes the shape
}

bool is_too_faint(const Bell& bell, double sigma, const PixelJudge& judge) {
  return bell.amplitude < least_amplitude(judge) || sigma > judge.max_sigma;
}

/// [frames] by which a bell is later than eq. 3 finds it, which takes all frames to be exposed evenly: how late the
/// samples were that tell its time, each as much as it tells.
double mean_lateness(const PixelWindow& window, const Bell& bell, const StripeProfile& profile) {
  if (window.late.empty()) return 0;
  double sum = 0, weights = 1e-12;
  for (std::size_t k = 0; k < window.gray.size(); ++k) {
    if (!std::isfinite(window.gray[k])) continue;
    const double frame = window.first_frame + static_cast<double>(k);
    const double slope = profile.derivative((frame - bell.time) / bell.width);
    weights += slope * slope;
    sum += slope * slope * window.late_of(k);
  }
  return sum / weights;
}

/// The bell's middle part on a curved background.
BellFit fit_core(const PixelWindow& window, const BellFit& first, const PixelJudge& judge) {
  const Bell& start = first.converged ? first.bell : window.start;
  const double reach = core_widths * judge.profile.full_width_half_maximum() * start.width;
  const int size = static_cast<int>(window.gray.size());
  const int begin = std::clamp(static_cast<int>(std::ceil(start.time - reach)) - window.first_frame, 0, size);
  const int end = std::clamp(static_cast<int>(std::floor(start.time + reach)) + 1 - window.first_frame, begin, size);
  const auto offset = static_cast<std::size_t>(begin), count = static_cast<std::size_t>(end - begin);
  return fit_bell(window.gray.subspan(offset, count), window.first_frame + begin, judge.profile, judge.noise, start,
                  {.unknowns = BellUnknowns::curved_background,
                   .late = window.late.empty() ? window.late : window.late.subspan(offset, count)});
}

/// An estimate of a bell's time, and what it is worth.
struct Opinion {
  bool converged;
  double time, sigma;  ///< [frames]
  double reduced_chi_square;
};
Opinion opinion_of(const BellFit& fit) {
  return {fit.converged, fit.bell.time, fit.time_sigma(), fit.reduced_chi_square()};
}
Opinion opinion_of(const PlainBells::Fit& fit, int unknowns) {
  return {fit.converged, fit.time, fit.time_sigma, fit.chi_square / std::max(1, fit.samples - unknowns)};
}

/// Whether a robust estimate shows the efficient one to be wrong.
bool contradicts(const Opinion& robust, const Opinion& efficient) {
  if (!robust.converged || robust.reduced_chi_square > efficient.reduced_chi_square) return false;
  if (!efficient.converged) return true;
  const double variance = std::max(robust.sigma * robust.sigma - efficient.sigma * efficient.sigma, 1e-12);
  return std::abs(robust.time - efficient.time) > 2 * std::sqrt(variance);
}

/// Whether a bell is higher than what its curved background bends by over the bell's core.
bool stands_out(const Bell& bell, const PixelJudge& judge) {
  const double core = core_widths * judge.profile.full_width_half_maximum() * bell.width;
  return bell.amplitude > std::abs(bell.curvature) * core * core;
}

/// [frames] What may be wrong with a time after a correction. A curved background takes up most of a hump, not all: up
/// to a third of the correction was missing in simulations.
double doubt_about(double correction) { return 0.25 * std::abs(correction); }

/// More than the noise tells, where residuals are more than noise.
double enlarged(double sigma, double reduced_chi_square, int samples) {
  return sigma * std::sqrt(std::max(1.0, reduced_chi_square / noise_limit(samples)));
}

/// What judge_bell() looks at besides the residuals.
/// \param flanks  gives them
template <class FlanksOf>
PixelStatus judge_but_for_shape(const Bell& bell, double sigma, const PixelJudge& judge, const FlanksOf& flanks) {
  constexpr double least_recorded = 0.6, least_usable = 0.02;
  if (!std::isfinite(bell.time) || !std::isfinite(sigma)) return PixelStatus::bad_fit;
  if (is_lost_in_noise(bell, judge)) return PixelStatus::too_dark;
  if (bell.time < 0 || bell.time > judge.frame_count - 1) return PixelStatus::truncated;
  const Flanks both = flanks();
  for (const Flank& flank : both)
    if (flank.recorded < least_recorded * flank.whole) return PixelStatus::truncated;
  for (const Flank& flank : both)
    if (flank.usable < least_usable * flank.whole)
      return flank.clipped > 0 ? PixelStatus::saturated : PixelStatus::truncated;
  return is_too_faint(bell, sigma, judge) ? PixelStatus::too_dark : PixelStatus::ok;
}

PixelTime describe(const PixelWindow& window, const Bell& bell, double sigma, double residual,
                   const PixelJudge& judge) {
  return {.time = bell.time,
          .sigma = sigma,
          .amplitude = bell.amplitude,
          .residual = residual,
          .background = bell.background,
          .bell_time = bell.time,
          .status = judge_bell(window, bell, sigma, judge)};
}

}  // namespace

PixelStatus judge_bell(const PixelWindow& window, const Bell& bell, double sigma, const PixelJudge& judge) {
  const auto flanks = [&] { return examine_flanks(window, bell, judge); };
  const PixelStatus status = judge_but_for_shape(bell, sigma, judge, flanks);
  if (status != PixelStatus::ok || !judge.refuse_misfits) return status;
  return misfits(window, bell, judge, most_misfit) ? PixelStatus::bad_fit : status;
}

PixelStatus judge_partial_bell(const PlainBells::Fit& fit, double sigma, const BellPlace& place, double width,
                               const PixelJudge& judge) {
  const Bell bell{fit.amplitude, fit.background, fit.time, width};
  return judge_but_for_shape(bell, sigma, judge, [&] { return examine_flanks(place, judge); });
}

std::optional<PixelTime> time_of_plain_bell(const PlainBells::Fit& fit, double width, const PixelJudge& judge) {
  if (!fit.converged) {
    // It rises towards an end of the recording and has its middle beyond.
    if (fit.time < 0 || fit.time > judge.frame_count - 1)
      return PixelTime{.amplitude = fit.amplitude, .bell_time = fit.time, .status = PixelStatus::truncated};
    return std::nullopt;
  }
  const double chi_square = fit.chi_square / std::max(1, fit.samples - 3);
  double sigma = fit.time_sigma;
  if (is_beyond_noise(chi_square, std::max(1.0, fit.samples - 3.0))) {
    if (judge.refuse_misfits) return std::nullopt;
    sigma *= std::sqrt(chi_square / noise_limit(fit.samples));
  }
  const Bell bell{fit.amplitude, fit.background, fit.time, width};
  const bool dark = is_lost_in_noise(bell, judge) || is_too_faint(bell, sigma, judge);
  return PixelTime{.time = fit.time,
                   .sigma = sigma,
                   .amplitude = fit.amplitude,
                   .residual = std::sqrt(chi_square),
                   .background = fit.background,
                   .bell_time = fit.time,
                   .status = dark ? PixelStatus::too_dark : PixelStatus::ok};
}

void judge_whole_bells(const BellBatch& batch, const PixelJudge& judge, BellVerdicts& verdicts) {
  const SensorNoise& noise = judge.noise.sensor();
  const auto read_variance = static_cast<float>(noise.read_variance), gain = static_cast<float>(noise.gain);
  const auto light = static_cast<float>(light_of(judge)), most_sigma = static_cast<float>(judge.max_sigma);
  const auto least = static_cast<float>(least_amplitude(judge));
  BellBatch::Each<float> width, freedom;
  width.fill(1);
  freedom.fill(1);
  for (std::size_t i = 0; i < static_cast<std::size_t>(batch.count); ++i) {
    width[i] = batch.table[i]->width * (1 + batch.width_rest[i]);
    freedom[i] = static_cast<float>(std::max(1, 2 * batch.table[i]->reach + 1 - 3));
  }
  // No branches: four at once on any machine.
  for (std::size_t i = 0; i < most_bells; ++i) {
    const float amplitude = batch.amplitude[i], background = std::max(batch.background[i], 0.0F);
    const float reduced_chi_square = std::max(batch.chi_square[i], 0.0F) / freedom[i];
    verdicts.residual[i] = std::sqrt(reduced_chi_square);
    verdicts.is_told[i] = (batch.good[i] > 0) & !is_beyond_noise(reduced_chi_square, freedom[i]);
    verdicts.is_dark[i] = is_lost_in_noise(amplitude, light * width[i], read_variance + gain * background) |
                          (amplitude < least) | (batch.sigma[i] > most_sigma);
  }
}

PixelTime time_of_doubtful_bell(const PlainBells::Fit& first, const PlainBells::Fit& second,
                                const std::function<BellPlace(double time)>& place_of, double width,
                                const PixelJudge& judge) {
  const Opinion efficient = opinion_of(first, 3), robust = opinion_of(second, 5);
  const bool is_corrected = contradicts(robust, efficient);
  const PlainBells::Fit& fit = is_corrected ? second : first;
  const double doubt = is_corrected ? doubt_about(second.time - first.time) : 0;
  const double reduced_chi_square = is_corrected ? robust.reduced_chi_square : efficient.reduced_chi_square;
  const double sigma = std::hypot(enlarged(fit.time_sigma, reduced_chi_square, fit.samples), doubt);
  const Bell bell{fit.amplitude, fit.background, fit.time, width, fit.slope, fit.curvature};
  const BellPlace place = place_of(fit.time);
  PixelStatus status = judge_but_for_shape(bell, sigma, judge, [&] { return examine_flanks(place, judge); });
  if (status == PixelStatus::ok && misfits(place, bell, judge, most_misfit)) status = PixelStatus::bad_fit;
  return {.time = fit.time,
          .sigma = sigma,
          .amplitude = fit.amplitude,
          .residual = std::sqrt(efficient.reduced_chi_square),
          .background = fit.background,
          .bell_time = fit.time,
          .status = status};
}

PixelTime time_by_center_of_mass(const PixelWindow& window, const PixelJudge& judge) {
  Bell bell = window.start;
  // Background: mean of what lies outside the profile's support.
  double outside = 0, background = 0, highest = 0;
  const auto time_of = [&](std::size_t k) { return window.time_of(k); };
  const auto noise_of = [&](std::size_t k) { return judge.noise.at(window.first_frame + static_cast<int>(k)); };
  const auto gray_of = [&](std::size_t k) { return std::min(window.gray[k], static_cast<float>(noise_of(k).ceiling)); };
  for (std::size_t k = 0; k < window.gray.size(); ++k) {
    const double gray = gray_of(k);
    if (std::isnan(window.gray[k])) continue;
    highest = std::max(highest, gray);
    if (std::abs(time_of(k) - bell.time) < 0.8 * judge.profile.end() * bell.width) continue;
    background += gray;
    outside += 1;
  }
  if (outside > 0) bell.background = background / outside;
  bell.amplitude = std::max(highest - bell.background, 0.0);
  const double threshold = bell.background + centre_threshold * bell.amplitude;
  double mass = 0, moment = 0, scatter = 0;
  for (int pass = 0; pass < 2; ++pass) {
    if (pass == 1) bell.time = moment / mass;
    for (std::size_t k = 0; k < window.gray.size(); ++k) {
      const double gray = gray_of(k);
      if (!(gray > threshold) || std::isnan(window.gray[k])) continue;
      if (pass == 0) {
        mass += gray - threshold;
        moment += (gray - threshold) * time_of(k);
      } else {
        const double lever = (time_of(k) - bell.time) / mass;
        scatter += lever * lever * noise_of(k).variance(gray);
      }
    }
    if (!(mass > 0)) return {};
  }
  bell.time -= judge.profile.upper_centre() * bell.width;
  return describe(window, bell, std::sqrt(scatter), 1, judge);
}

PixelTime time_by_shift(const PixelWindow& window, const PixelJudge& judge) {
  constexpr int longest = 512;  // [frames] of a profile: far more than a stripe of use is long
  const double width = window.start.width;
  const int before = static_cast<int>(std::ceil(-judge.profile.begin() * width));
  const int after = static_cast<int>(std::ceil(judge.profile.end() * width));
  std::array<float, longest> f;
  const int count = std::min(longest, before + after + 1);
  for (int k = 0; k < count; ++k)
    f[static_cast<std::size_t>(k)] = static_cast<float>(judge.profile.value((k - before) / width));
  const int start = static_cast<int>(window.start.time) - window.first_frame - before;
  const auto shift = refine_shift({f.data(), static_cast<std::size_t>(count)}, window.gray, start);
  if (!shift) {
    PixelTime unsolved;
    unsolved.amplitude = window.start.amplitude;
    unsolved.status = std::ranges::any_of(window.gray, [](float gray) { return std::isinf(gray); })
                          ? PixelStatus::saturated
                          : PixelStatus::truncated;
    return unsolved;
  }
  Bell bell{shift->a, shift->b, shift->c + window.first_frame + before, width};
  bell.time += mean_lateness(window, bell, judge.profile);
  const double noise = std::sqrt(judge.noise.sensor().variance(bell.background + 0.5 * bell.amplitude));
  // What the noise alone would leave. Eq. 9's own residuals know less: the noise in its matrix passes for slope.
  const BellFit at_bell = fit_bell(window.gray, window.first_frame, judge.profile, judge.noise, bell,
                                   {.most_iterations = 1, .late = window.late});
  return describe(window, bell, at_bell.time_sigma(), shift->residual_rms / noise, judge);
}

PixelTime time_by_likelihood(const PixelWindow& window, const PixelJudge& judge) {
  BellFit fit =
      fit_bell(window.gray, window.first_frame, judge.profile, judge.noise, window.start, {.late = window.late});
  const double misfit = std::sqrt(fit.reduced_chi_square());
  double doubt = 0;  // [frames] about a correction
  if (judge.refuse_misfits && fit.reduced_chi_square() > noise_limit(fit.samples)) {
    const BellFit second = fit_core(window, fit, judge);
    // Without a first opinion, a second one may be any rise towards the recording's end.
    const bool is_bell = fit.converged || stands_out(second.bell, judge);
    if (is_bell && contradicts(opinion_of(second), opinion_of(fit))) {
      doubt = doubt_about(second.bell.time - fit.bell.time);
      fit = second;
    }
  }
  const double sigma = enlarged(fit.time_sigma(), fit.reduced_chi_square(), fit.samples);
  PixelTime result = describe(window, fit.bell, std::hypot(sigma, doubt), misfit, judge);
  if (!fit.converged && result.status == PixelStatus::ok) result.status = PixelStatus::bad_fit;
  return result;
}

}  // namespace pagesweep
