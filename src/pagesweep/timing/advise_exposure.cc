// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/advise_exposure.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace pagesweep {
namespace {

constexpr double bright_share = 0.005;                   ///< of the pixels that may reach the end of the range
constexpr double target = 0.92;                          ///< of the range for them: light is never quite the same twice
constexpr double least_change = 0.8, most_change = 1.3;  ///< of the light, that are not worth the trouble
constexpr double narrowest = 4, widest = 16, good_width = 8;  ///< [frames] of the stripe
constexpr float least_amplitude = 5;                          ///< [gray values] below which no stripe passed
constexpr double longest_exposure = 0.9;                      ///< of the interval between frames

double rounded(double factor) { return factor < 10 ? std::round(factor * 20) / 20 : std::round(factor); }

}  // namespace

ExposureAdvice advise_exposure(const Sequence& sequence, const TimeMap& times, const Image<std::uint8_t>& clipped,
                               const StripeProfile& profile) {
  ExposureAdvice advice;
  std::vector<float> heights;
  double clipped_count = 0, dark = 0;
  for (std::size_t i = 0; i < times.amplitude.size(); ++i) {
    const bool is_clipped = !clipped.empty() && clipped.data()[i] > 0;
    const float amplitude = times.amplitude.data()[i];
    if (!is_clipped && !(amplitude > least_amplitude)) continue;
    heights.push_back(std::isfinite(amplitude) ? amplitude : 0);
    clipped_count += is_clipped;
    dark += times.status.data()[i] == PixelStatus::too_dark;
  }
  advice.stripe_frames = profile.full_width_half_maximum();
  if (heights.empty()) return advice;
  const auto count = static_cast<double>(heights.size());
  advice.clipped_share = clipped_count / count;
  advice.dark_share = dark / count;
  const auto high = heights.begin() + static_cast<std::ptrdiff_t>((1 - bright_share) * (count - 1));
  std::nth_element(heights.begin(), high, heights.end());
  advice.top = *high / (sequence.saturation - sequence.black_level);
  // What was clipped is known to be higher than the range, by how much is not known well.
  if (advice.clipped_share > bright_share) advice.top = std::max(advice.top, 1.0);
  if (advice.top > 0) advice.light_factor = target / advice.top;
  if (advice.stripe_frames < narrowest || advice.stripe_frames > widest)
    advice.speed_factor = advice.stripe_frames / good_width;
  const bool light_is_good = advice.light_factor > least_change && advice.light_factor < most_change &&
                             advice.clipped_share < 4 * bright_share;
  if (light_is_good) advice.light_factor = 1;
  advice.is_good = light_is_good && advice.speed_factor == 1;
  return advice;
}

std::string describe(const ExposureAdvice& advice, double exposure_ms, double interval_ms) {
  std::string text = fmt::format(
      "{:.2g} % of the lit pixels clip, {:.2g} % are too dark, the brightest use {:.0f} % of "
      "the range, the stripe is {:.1f} frames wide",
      100 * advice.clipped_share, 100 * advice.dark_share, 100 * advice.top, advice.stripe_frames);
  if (advice.is_good) return text + ": well exposed";
  if (advice.light_factor != 1) {
    const double factor = rounded(advice.light_factor);
    text +=
        fmt::format("; {} the light: {:g} times the exposure", factor < 1 ? "take less of" : "take more of", factor);
    if (exposure_ms > 0) text += fmt::format(", {:.3g} ms", factor * exposure_ms);
    if (interval_ms > 0 && exposure_ms * factor > longest_exposure * interval_ms)
      text += fmt::format(
          ", which at one frame in {:.3g} ms is too long: {:.2g} ms and {:.2g} times the gain, or a slower "
          "sweep",
          interval_ms, longest_exposure * interval_ms, factor * exposure_ms / (longest_exposure * interval_ms));
    else
      text += " or, where the frame rate does not allow that, the gain";
  }
  if (advice.speed_factor < 1)
    text += fmt::format("; move the light at {:.2g} of the speed, or take more frames a second", advice.speed_factor);
  if (advice.speed_factor > 1) text += fmt::format("; the light may move {:.2g} times as fast", advice.speed_factor);
  return text;
}

}  // namespace pagesweep
