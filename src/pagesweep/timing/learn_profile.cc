// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/learn_profile.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

#include "pagesweep/base/error.h"
#include "pagesweep/base/median.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/timing/bell_fit.h"
#include "pagesweep/timing/profile_bins_internal.h"
#include "pagesweep/timing/pupil_search_internal.h"

namespace pagesweep {
namespace {

constexpr int first_lesson = 32;    // [frames]
constexpr double widest_reach = 3;  // [fwhm] to both sides that is looked at

/// Median width at half height of the pixels in use.
double typical_width(const std::vector<Pupil>& pupils) {
  std::vector<double> widths;
  for (const Pupil& pupil : pupils) widths.push_back(pupil.fwhm);
  return median(widths);
}

/// Which frames there are to learn from.
struct Lesson {
  int end;       ///< [frames]
  bool is_last;  ///< no more will come
};

/// Keeps the best teachers of one camera: unclipped if there are enough, bright, of usual width, wholly recorded: with
/// all that the profile may reach, as long as waiting helps.
std::vector<Pupil> select(std::vector<Pupil> pupils, std::size_t most, const Lesson& lesson) {
  constexpr std::size_t enough = 60;
  const auto unclipped = std::ranges::count_if(pupils, [](const Pupil& p) { return !p.clipped; });
  if (static_cast<std::size_t>(unclipped) >= std::min(enough, std::max<std::size_t>(1, pupils.size() / 4)))
    std::erase_if(pupils, [](const Pupil& p) { return p.clipped; });
  if (pupils.empty()) return pupils;
  std::vector<double> amplitudes;
  for (const Pupil& pupil : pupils) amplitudes.push_back(pupil.amplitude);
  const auto high = amplitudes.begin() + static_cast<std::ptrdiff_t>(amplitudes.size() * 19 / 20);
  std::nth_element(amplitudes.begin(), high, amplitudes.end());
  std::erase_if(pupils, [bright = 0.5 * *high](const Pupil& p) { return p.amplitude < bright; });
  const double width = typical_width(pupils);
  const double margin = (lesson.is_last ? 1.5 : widest_reach) * width;
  std::erase_if(pupils, [&](const Pupil& p) {
    return std::abs(p.fwhm - width) > 0.35 * width || p.middle < margin || p.middle > lesson.end - 1 - margin;
  });
  std::ranges::sort(pupils, {}, &Pupil::rank);
  if (pupils.size() > most) pupils.resize(most);
  return pupils;
}

/// Whether to wait for more would teach little: there are many, and of paper. What the stripe meets first may be a dark
/// table, by whose light the stripe's shape is badly known.
bool suffice(const std::vector<Pupil>& pupils, std::size_t most, double ceiling) {
  if (pupils.size() < most / 4 + 1) return false;
  std::vector<double> amplitudes;
  for (const Pupil& pupil : pupils) amplitudes.push_back(pupil.amplitude);
  return median(amplitudes) > ceiling / 8;
}

/// Something bell-like to align with for the first time: a raised cosine.
StripeProfile raised_cosine(double fwhm) {
  std::vector<StripeProfile::Point> points;
  for (double t = -2 * fwhm; t <= 2 * fwhm; t += fwhm / 50)
    points.push_back({t, std::abs(t) < fwhm ? 0.5 + 0.5 * std::cos(std::numbers::pi * t / fwhm) : 0});
  return StripeProfile::fit(points, -1.5 * fwhm, 1.5 * fwhm, fwhm / 8);
}

/// Close below the ceiling those samples are clipped whose noise is positive. To leave out whole moments, as the model
/// has them, and not single samples, as they came out, keeps the profile's tip from a bias.
bool is_near_ceiling(double model, const SensorNoise& noise) {
  const double below = noise.ceiling - model;
  return below < 0 || below * below < 3 * 3 * noise.variance(model);
}

class Teacher {
 public:
  /// \param samples  of each pupil, widest_reach to both sides of its middle
  Teacher(std::vector<Pupil> pupils, std::vector<PupilSamples> samples, std::vector<FrameNoise> noise)
      : pupils_(std::move(pupils)), samples_(std::move(samples)), noise_(std::move(noise)) {
    fwhm_ = typical_width(pupils_);
    reach_ = widest_reach / 1.2 * fwhm_;
    learned_.profile = raised_cosine(fwhm_);
    only_flanks_ = std::ranges::all_of(pupils_, [](const Pupil& p) { return p.clipped; });
  }

  LearnedStripe run() {
    const int iterations = number_of_iterations();
    for (int iteration = 0; iteration < iterations; ++iteration) {
      align(iteration);
      average(iteration + 2 >= iterations);
      if (iteration > 0) learn_noise(iteration + 1 == iterations);
    }
    for (const FrameNoise& noise : noise_) learned_.noise.push_back(noise.sensor());
    return std::move(learned_);
  }

 private:
  int number_of_iterations() const {
    // With a profile that is still wrong, a bell lies otherwise when frames of one exposure are at its middle than when
    // those of the other are: a ripple of that period goes into the profile and fades slowly (after
    // 8 rounds errors of 1.2 bounds are left, after 20 none).
    const bool differ = std::ranges::any_of(noise_, [](const FrameNoise& noise) { return noise.mean_weight() < 1; });
    if (differ) return 20;
    return only_flanks_ ? 8 : 5;
  }

  void align(int iteration) {
    fits_.resize(pupils_.size());
    // With the first profile, which is wrong, no widths can be told.
    const bool fit_width = iteration > 0 && !only_flanks_;
    const BellFitOptions common{.unknowns = fit_width ? BellUnknowns::width : BellUnknowns::basic,
                                .log_width_sigma = 0.1,
                                .most_iterations = 20};
    parallel_ranges(static_cast<int>(pupils_.size()), 64, [&](int begin, int end) {
      for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
        const Pupil& pupil = pupils_[i];
        const PupilSamples& samples = samples_[i];
        Bell start = iteration == 0 ? Bell{pupil.amplitude, pupil.background, pupil.middle} : fits_[i].bell;
        start.width = 1;
        BellFitOptions options = common;
        options.late = samples.late;
        fits_[i] = fit_bell(samples.gray, samples.first_frame, learned_.profile, noise_[pupil.camera], start, options);
      }
    });
    centre_widths();
  }

  /// Widths are relative to the median one.
  void centre_widths() {
    std::vector<double> widths;
    for (const BellFit& fit : fits_)
      if (fit.converged) widths.push_back(fit.bell.width);
    if (widths.empty())
      throw no_result("the stripe's profile could not be learned: no gray value sequence fits another");
    const double middle = median(widths);
    for (BellFit& fit : fits_) fit.bell.width /= middle;
  }

  /// The samples of all well fitted pixels in common time and height, robustly averaged, become the next profile.
  void average(bool final_support) {
    const double spacing = std::clamp(fwhm_ / 14, 0.2, 0.5);
    const double begin = final_support ? support_begin() : -reach_;
    const double end = final_support ? support_end() : reach_;
    const double limit = usual_misfit() * 2;
    ProfileBins bins(begin, end, spacing / 4);
    bins.fill(pupils_.size(), [&](std::size_t i, std::vector<StripeProfile::Point>& points) {
      if (fits_[i].converged && misfit(fits_[i]) <= limit) scatter(i, points);
    });
    std::vector<StripeProfile::Point> points = bins.robust_means();
    if (!final_support) remove_baseline(points);
    learned_.profile = StripeProfile::fit(points, begin, end, spacing);
  }

  /// What is left where no stripe is any more would otherwise be learned as part of it, as the fits' background allows.
  void remove_baseline(std::vector<StripeProfile::Point>& points) const {
    double weight = 0, sum = 0;
    const double before = points.front().time, after = points.back().time, outer = 0.15 * fwhm_;
    for (const auto& point : points)
      if (point.time < before + outer || point.time > after - outer) {
        weight += point.weight;
        sum += point.weight * point.value;
      }
    for (auto& point : points) point.value -= sum / weight;
  }

  static double misfit(const BellFit& fit) { return std::sqrt(fit.reduced_chi_square()); }
  double usual_misfit() const {
    std::vector<double> misfits;
    for (const BellFit& fit : fits_)
      if (fit.converged) misfits.push_back(misfit(fit));
    return median(misfits);
  }

  /// The samples of a pupil in the profile's time and height.
  void scatter(std::size_t i, std::vector<StripeProfile::Point>& points) const {
    const PupilSamples& samples = samples_[i];
    const Bell& bell = fits_[i].bell;
    for (std::size_t k = 0; k < samples.gray.size(); ++k) {
      const SensorNoise& noise = noise_[pupils_[i].camera].at(samples.first_frame + static_cast<int>(k));
      const double gray = samples.gray[k], frame = samples.time_of(k);
      const double model = bell.gray_at(frame, learned_.profile);
      if (!std::isfinite(gray) || is_near_ceiling(model, noise)) continue;
      const double weight = bell.amplitude * bell.amplitude / noise.variance(model);
      points.push_back({(frame - bell.time) / bell.width, (gray - bell.background) / bell.amplitude, weight});
    }
  }

  /// The support ends where nothing clearly above 0 is left, with a knot or two to fall to 0 smoothly.
  double support_begin() const {
    double t = learned_.profile.begin();
    while (t < -0.8 * fwhm_ && std::abs(learned_.profile.value(t)) < negligible) t += 0.02 * fwhm_;
    return std::max(learned_.profile.begin(), t - 0.15 * fwhm_);
  }
  double support_end() const {
    double t = learned_.profile.end();
    while (t > 0.8 * fwhm_ && std::abs(learned_.profile.value(t)) < negligible) t -= 0.02 * fwhm_;
    return std::min(learned_.profile.end(), t + 0.15 * fwhm_);
  }

  /// \param is_last  before, a quarter of the pixels tell the noise well enough to weight samples with
  void learn_noise(bool is_last) {
    const std::size_t step = is_last ? 1 : 4;
    const double limit = usual_misfit() * 2;
    parallel_rows(static_cast<int>(noise_.size()), [&](int c) {
      const auto camera = static_cast<std::size_t>(c);
      std::vector<NoiseSample> samples;
      for (std::size_t i = 0; i < pupils_.size(); i += step)
        if (pupils_[i].camera == camera && fits_[i].converged && misfit(fits_[i]) <= limit) collect_noise(i, samples);
      if (samples.empty()) return;
      SensorNoise noise = fit_sensor_noise(samples);
      noise.ceiling = noise_[camera].sensor().ceiling;
      noise_[camera] = noise_[camera].with(noise);
    });
  }

  /// As the sensor had them, whatever their exposure.
  void collect_noise(std::size_t i, std::vector<NoiseSample>& collected) const {
    const PupilSamples& samples = samples_[i];
    const BellFit& fit = fits_[i];
    const FrameNoise& camera_noise = noise_[pupils_[i].camera];
    for (std::size_t k = 0; k < samples.gray.size(); ++k) {
      if (!std::isfinite(samples.gray[k])) continue;
      const int frame = samples.first_frame + static_cast<int>(k);
      const SensorNoise& noise = camera_noise.at(frame);
      const double exposure = camera_noise.exposure(frame);
      const Eigen::Vector4d gradient = bell_gradient(fit.bell, learned_.profile, samples.time_of(k));
      const double model = fit.bell.amplitude * gradient(0) + fit.bell.background;
      if (is_near_ceiling(model, noise)) continue;
      const double leverage = gradient.dot(fit.covariance.topLeftCorner<4, 4>() * gradient) / noise.variance(model);
      const double residual = exposure * (samples.gray[k] - model);
      collected.push_back({exposure * model, residual * residual / std::max(0.2, 1 - leverage)});
    }
  }

  static constexpr double negligible = 0.003;

  std::vector<Pupil> pupils_;
  std::vector<PupilSamples> samples_;  ///< of each
  std::vector<FrameNoise> noise_;      ///< one a camera
  std::vector<BellFit> fits_;
  LearnedStripe learned_;
  double fwhm_ = 0;   ///< [frames]
  double reach_ = 0;  ///< [frames] before and after the middle within which the profile is looked for
  bool only_flanks_ = false;
};

/// The samples of pupils of all cameras, as far as they are looked at.
std::vector<PupilSamples> read_samples(std::span<const Frames> cameras, const std::vector<PupilSearch>& searches,
                                       const std::vector<Pupil>& pupils, int end) {
  const double reach = widest_reach * typical_width(pupils);
  std::vector<PupilSamples> samples(pupils.size());
  parallel_ranges(static_cast<int>(pupils.size()), 64, [&](int first, int last) {
    for (auto i = static_cast<std::size_t>(first); i < static_cast<std::size_t>(last); ++i) {
      const std::size_t c = pupils[i].camera;
      samples[i] = searches[c].samples(cameras[c], pupils[i], reach, std::min(end, cameras[c].count()));
    }
  });
  return samples;
}

}  // namespace

StripeLearner::StripeLearner(int most_pixels) : most_pixels_(most_pixels) {}
StripeLearner::~StripeLearner() = default;

std::optional<LearnedStripe> StripeLearner::learn(std::span<const Frames> cameras, int end) {
  for (std::size_t c = searches_.size(); c < cameras.size(); ++c) searches_.emplace_back(cameras[c].sequence(), c);
  std::vector<Pupil> pupils;
  std::vector<FrameNoise> noise;
  const bool is_last = std::ranges::all_of(cameras, [end](const Frames& frames) { return end >= frames.count(); });
  const auto share = static_cast<std::size_t>(most_pixels_) / std::max<std::size_t>(1, cameras.size());
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const Lesson lesson{std::min(end, cameras[c].count()), is_last};
    noise.push_back(searches_[c].noise());
    std::vector<Pupil> own = select(searches_[c].find(cameras[c], lesson.end), share, lesson);
    if (!is_last && !suffice(own, share, noise.back().sensor().ceiling)) return std::nullopt;
    std::ranges::move(own, std::back_inserter(pupils));
  }
  if (pupils.empty()) throw no_result("no stripe of light passes in the frames: no pixel rises and falls once");
  std::vector<PupilSamples> samples = read_samples(cameras, searches_, pupils, end);
  return Teacher(std::move(pupils), std::move(samples), std::move(noise)).run();
}

LearnedStripe StripeLearner::learn_from_all(std::span<const Frames> cameras, int end) {
  int count = 0;
  for (const Frames& frames : cameras) count = std::max(count, frames.count());
  for (; end < count; end = next_lesson(end))
    if (auto learned = learn(cameras, end)) return *std::move(learned);
  return *learn(cameras, count);
}

int next_lesson(int end) { return end < first_lesson ? first_lesson : end + end / 4; }

LearnedStripe learn_stripe(std::span<const Frames> cameras, int most_pixels) {
  return StripeLearner(most_pixels).learn_from_all(cameras, next_lesson(0));
}

}  // namespace pagesweep
