// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/planning/plan_time.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <vector>

namespace pagesweep {
namespace {

constexpr int phases = 16;              // positions between two frames
constexpr double reach = 6;             // of the bell to both sides [sigma]
constexpr double most_frames = 10'000;  // of a bell: what is longer is a mistake

double full_width_of_sigma() { return 2 * std::sqrt(2 * std::numbers::ln2); }

/// A Gaussian, and the same averaged over an exposure.
class Bell {
 public:
  Bell(double sigma_frames, double exposure_frames) : sigma_(sigma_frames), half_(0.5 * exposure_frames) {}

  double end() const { return reach * sigma_ + half_; }
  BellSample at(double t) const {
    if (half_ < 1e-3 * sigma_) return {gauss(t), -t / (sigma_ * sigma_) * gauss(t)};
    return {integral(t) / integral(0), (gauss(t + half_) - gauss(t - half_)) / integral(0)};
  }

 private:
  double gauss(double t) const { return std::exp(-0.5 * t * t / (sigma_ * sigma_)); }
  /// Of the Gaussian over the exposure around t.
  double integral(double t) const {
    const double scale = sigma_ * std::numbers::sqrt2;
    return std::sqrt(std::numbers::pi / 2) * sigma_ * (std::erf((t + half_) / scale) - std::erf((t - half_) / scale));
  }

  double sigma_, half_;
};

/// NaN is not within.
void require(bool is_within, const char* option, double value, const char* expected) {
  if (!is_within) throw std::invalid_argument(fmt::format("--{} {}: expected {}", option, value, expected));
}

void require_sound(const RecordingPlan& plan, double mm_per_frame) {
  require(plan.amplitude > 0 && plan.amplitude <= 100, "amplitude", plan.amplitude, "above 0, at most 100");
  require(plan.full_well_electrons >= 1 && plan.full_well_electrons <= 1e9, "full-well", plan.full_well_electrons,
          "1 to 1e9 electrons");
  require(plan.read_noise_electrons >= 0 && plan.read_noise_electrons <= plan.full_well_electrons, "read-noise",
          plan.read_noise_electrons, "0 electrons to the full well");
  require(plan.bits >= 1 && plan.bits <= 16, "bits", plan.bits, "1 to 16");
  require(mm_per_frame > 0 && mm_per_frame <= 1e6, "mm-per-frame", mm_per_frame, "a speed above 0");
  require(plan.stripe_mm > 0 && plan.stripe_mm / mm_per_frame <= most_frames, "stripe-mm", plan.stripe_mm,
          "above 0, and at most 10000 frames long");
  require(plan.exposure_frames >= 0 && plan.exposure_frames <= 1, "exposure", plan.exposure_frames,
          "0 to 1 frame: the next one begins then");
}

}  // namespace

TimeVariance plan_time(const RecordingPlan& plan, double mm_per_frame) {
  require_sound(plan, mm_per_frame);
  const double highest = std::exp2(plan.bits) - 1;
  const double gray_per_electron = highest / plan.full_well_electrons;
  SampleNoise noise;
  noise.shot_gray = gray_per_electron;
  noise.read_variance = std::pow(plan.read_noise_electrons * gray_per_electron, 2);
  noise.clips_at_gray = highest;

  const double stripe_frames = plan.stripe_mm / mm_per_frame;
  const Bell bell(stripe_frames / full_width_of_sigma(), plan.exposure_frames);
  const int end = static_cast<int>(std::ceil(bell.end())) + 1;
  TimeVariance mean;
  std::vector<BellSample> samples;
  for (int phase = 0; phase < phases; ++phase) {
    samples.clear();
    for (int i = -end; i <= end; ++i) samples.push_back(bell.at(i - (phase + 0.5) / phases));
    const TimeVariance variance = time_variance(samples, plan.amplitude * highest, noise);
    mean.shot += variance.shot / phases;
    mean.read += variance.read / phases;
    mean.rounding += variance.rounding / phases;
  }
  const double useless = 0.5 * std::max(1.0, stripe_frames);  // the brightest frame alone tells as much
  if (!(std::sqrt(mean.total()) < useless)) mean.shot = std::numeric_limits<double>::infinity();
  return mean;
}

double best_stripe_mm(const RecordingPlan& recording, double mm_per_frame) {
  // Of the widths that span 0.2 to 20 frames; below, no frame sees the stripe, above, none is missed.
  double best_mm = recording.stripe_mm, least = std::numeric_limits<double>::infinity();
  for (double frames = 0.2; frames < 20; frames *= 1.01) {
    RecordingPlan varied = recording;
    varied.stripe_mm = frames * mm_per_frame;
    const double variance = plan_time(varied, mm_per_frame).total();
    if (!(variance < least)) continue;
    least = variance;
    best_mm = varied.stripe_mm;
  }
  return best_mm;
}

}  // namespace pagesweep
