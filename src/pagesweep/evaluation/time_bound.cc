// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/evaluation/time_bound.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "pagesweep/planning/time_variance.h"

namespace pagesweep {
namespace {

// The table's amplitudes: 0.5 * 2^(k / 8) gray values, up to 2^17.
constexpr double first_amplitude = 0.5;
constexpr double steps_an_octave = 8;
constexpr int table_size = 145;
constexpr int phases = 8;
constexpr std::size_t most_turns = 16;  // of the exposures that are looked at

}  // namespace

TimeBound::TimeBound(const TruthProfile& profile, const TruthSensor& sensor, double clips_at_gray,
                     std::vector<double> exposures)
    : profile_(profile), sensor_(sensor), clips_at_gray_(clips_at_gray), exposures_(std::move(exposures)) {
  if (profile.values.size() < 3 || !(profile.step_frames > 0) || !(sensor.gain_e_per_gray > 0))
    throw std::invalid_argument("TimeBound: the profile needs three samples and a step, the sensor a gain");
  if (exposures_.empty()) exposures_ = {1};
  const std::size_t turns = std::min(exposures_.size(), most_turns);
  for (int k = 0; k < table_size; ++k) {
    const double amplitude = first_amplitude * std::exp2(k / steps_an_octave);
    double sum = 0;
    for (std::size_t turn = 0; turn < turns; ++turn)
      for (int phase = 0; phase < phases; ++phase) {
        const auto frame = static_cast<double>(turn * exposures_.size() / turns);
        sum += variance(amplitude, frame + (phase + 0.5) / phases);
      }
    table_.push_back(std::sqrt(sum / (phases * static_cast<double>(turns))));
  }
}

double TimeBound::light_at(double frames) const {
  const double position = (frames - profile_.start_frames) / profile_.step_frames;
  const auto last = static_cast<double>(profile_.values.size() - 1);
  if (!(position >= 0 && position <= last)) return 0;
  const auto below = std::min(static_cast<std::size_t>(position), profile_.values.size() - 2);
  const double share = position - static_cast<double>(below);
  return (1 - share) * profile_.values[below] + share * profile_.values[below + 1];
}

double TimeBound::variance(double amplitude_gray, double middle_frames) const {
  const double end = profile_.start_frames + profile_.step_frames * static_cast<double>(profile_.values.size() - 1);
  // Half a step to both sides: the slope of the piecewise linear profile, averaged over its corners.
  const double h = 0.5 * profile_.step_frames;
  const int first = static_cast<int>(std::floor(middle_frames + profile_.start_frames)) - 1;
  const auto period = static_cast<int>(exposures_.size());
  std::vector<BellSample> bell;
  for (int i = first; i <= middle_frames + end + 1; ++i) {
    const double since_middle = i - middle_frames;
    bell.push_back({.light = light_at(since_middle),
                    .slope = (light_at(since_middle + h) - light_at(since_middle - h)) / (2 * h),
                    .exposure = exposures_[static_cast<std::size_t>((i % period + period) % period)]});
  }
  SampleNoise noise;
  noise.shot_gray = 1 / sensor_.gain_e_per_gray;
  noise.read_variance = std::pow(sensor_.read_noise_gray, 2);
  noise.clips_at_gray = clips_at_gray_;
  return time_variance(bell, amplitude_gray, noise).total();
}

double TimeBound::operator()(double amplitude_gray) const {
  if (!(amplitude_gray > 0)) return std::numeric_limits<double>::quiet_NaN();
  const double position =
      std::clamp(std::log2(amplitude_gray / first_amplitude) * steps_an_octave, 0.0, table_size - 1.0);
  const auto below = std::min(static_cast<std::size_t>(position), table_.size() - 2);
  const double share = position - static_cast<double>(below);
  return (1 - share) * table_[below] + share * table_[below + 1];
}

}  // namespace pagesweep
