// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/learn_profile.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <limits>
#include <numbers>

#include "pagesweep/base/error.h"
#include "pagesweep/base/median.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/timing/bell_fit.h"

namespace pagesweep {
namespace {

/// A gray value sequence that may teach the profile.
struct Pupil {
  std::size_t camera = 0;
  std::vector<float> gray;
  int first_frame = 0;      ///< of gray, after it was cut to the stripe's surroundings
  std::vector<float> late;  ///< [frames] by which each sample was exposed later; empty: not at all
  bool clipped = false;     ///< at least one sample of the shortest exposure is
  double middle = 0;        ///< [frames] between the crossings of half height
  double fwhm = 0;          ///< [frames]
  Bell bell;
  std::uint64_t rank = 0;  ///< random, fixed by the pixel's place

  double time_of(std::size_t k) const {
    return first_frame + static_cast<double>(k) + (late.empty() ? 0 : static_cast<double>(late[k]));
  }
};

constexpr int first_lesson = 32;                             // [frames]
constexpr double widest_reach = 3;                           // [fwhm] to both sides that is looked at
constexpr int rows_looked_at = 64, columns_looked_at = 256;  // of each camera: enough pixels for any subset

std::uint64_t mix(std::uint64_t z) {  // splitmix64's finaliser
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
  return z ^ (z >> 31);
}

double ceiling_of(const Frames& frames) {
  // A gray value stands for all light that rounds to it.
  return frames.sequence().saturation - frames.sequence().black_level - 0.5;
}

/// Where the sequence crosses a level, walking from `from` in steps of `direction`; NaN if it never does.
double crossing(std::span<const float> gray, int from, int direction, float level) {
  float before = std::numeric_limits<float>::quiet_NaN();
  for (int i = from; i >= 0 && i < static_cast<int>(gray.size()); i += direction) {
    const float here = gray[static_cast<std::size_t>(i)];
    if (std::isnan(here)) continue;
    if (here <= level) {
      const double share = std::isfinite(before) ? (level - here) / (before - here) : 0.5;
      return i - direction * share;
    }
    before = here;
  }
  return std::numeric_limits<double>::quiet_NaN();
}

/// Whether each column of samples of one exposure may be a complete bell clearly above the noise. What examine() would
/// take is never refused; most of what it would not take is, side by side and without sorting.
class Glance {
 public:
  /// \param step  from one column to the next
  void look(const Image<float>& samples, int step, float ceiling) {
    columns_ = static_cast<std::size_t>((samples.width() + step - 1) / step);
    gather(samples, step, ceiling);
    outline();
    count_changes();
  }
  bool may_be_bell(std::size_t column) const {
    const Outline& o = outline_;
    const float low = o.low[column], high = o.high[column];
    const auto frames = static_cast<float>(seen_.size()) / static_cast<float>(columns_);
    // Three quarters of the samples are not below the lower quartile, which is the background's level.
    const float most_background = low + 4 / 3.0F * (o.sum[column] / frames - low);
    const float half = 0.5F * (high + most_background) + slack;
    const bool is_complete = o.low_before[column] <= half && o.low_after[column] <= half;
    return is_complete && high - low > 5 - slack && small_changes_[column] > 0.5F * (frames - 2);
  }

 private:
  static constexpr float slack = 1e-3F;  // [gray values] for rounding
  struct Outline {
    std::vector<float> low, high, low_before, low_after, sum;  ///< before and after the highest sample
  };

  void gather(const Image<float>& samples, int step, float ceiling) {
    seen_.clear();
    for (int i = 0; i < samples.height(); ++i) {
      if (std::isnan(samples(0, i))) continue;
      for (int x = 0; x < samples.width(); x += step) seen_.push_back(std::min(samples(x, i), ceiling));
    }
  }

  void outline() {
    constexpr float infinity = std::numeric_limits<float>::infinity();
    Outline& o = outline_;
    for (auto* values : {&o.low, &o.low_before, &o.low_after}) values->assign(columns_, infinity);
    o.high.assign(columns_, -infinity);
    o.sum.assign(columns_, 0);
    for (std::size_t row = 0; row < seen_.size(); row += columns_)
      for (std::size_t x = 0; x < columns_; ++x) {
        const float gray = seen_[row + x];
        const bool is_higher = gray > o.high[x];
        o.low_before[x] = is_higher ? o.low[x] : o.low_before[x];
        const float after = gray < o.low_after[x] ? gray : o.low_after[x];
        o.low_after[x] = is_higher ? infinity : after;
        o.high[x] = is_higher ? gray : o.high[x];
        o.low[x] = gray < o.low[x] ? gray : o.low[x];
        o.sum[x] += gray;
      }
  }

  /// How many changes from frame to frame are small enough for the bell to stand out, were they the median one.
  void count_changes() {
    small_changes_.assign(columns_, 0);
    for (std::size_t row = columns_; row < seen_.size(); row += columns_)
      for (std::size_t x = 0; x < columns_; ++x) {
        const float change = std::abs(seen_[row + x] - seen_[row - columns_ + x]);
        small_changes_[x] += change <= 0.1F * (outline_.high[x] - outline_.low[x]) + slack ? 1.0F : 0.0F;
      }
  }

  std::size_t columns_ = 0;
  std::vector<float> seen_;  ///< a row a frame that is there
  Outline outline_;
  std::vector<float> small_changes_;
};

/// Fills in what an outline shows without a profile. \return whether a complete bell clearly above the noise is there
bool examine(Pupil& pupil, std::span<const float> outline, double ceiling) {
  thread_local std::vector<double> present, changes;  // used again: there are many pupils
  present.clear();
  changes.clear();
  int peak = -1;
  for (int i = 0; i < static_cast<int>(outline.size()); ++i) {
    const float gray = outline[static_cast<std::size_t>(i)];
    if (std::isnan(gray)) continue;
    const double seen = std::min(static_cast<double>(gray), ceiling);
    if (!present.empty()) changes.push_back(std::abs(seen - present.back()));
    present.push_back(seen);
    if (peak < 0 || gray > outline[static_cast<std::size_t>(peak)]) peak = i;
  }
  if (present.size() < 8) return false;
  const double high = std::min(static_cast<double>(outline[static_cast<std::size_t>(peak)]), ceiling);
  // The stripe passes quickly: the lower half of the samples is background, whatever the drift.
  const auto quarter = present.begin() + static_cast<std::ptrdiff_t>(present.size() / 4);
  std::nth_element(present.begin(), quarter, present.end());
  pupil.bell.background = *quarter;
  pupil.bell.amplitude = high - pupil.bell.background;
  const auto middle = changes.begin() + static_cast<std::ptrdiff_t>(changes.size() / 2);
  std::nth_element(changes.begin(), middle, changes.end());
  const double noise = std::max(*middle, 0.5);
  pupil.clipped = std::isinf(outline[static_cast<std::size_t>(peak)]);
  if (pupil.bell.amplitude < 10 * noise) return false;
  const auto half = static_cast<float>(pupil.bell.background + 0.5 * pupil.bell.amplitude);
  const double rise = crossing(outline, peak, -1, half), fall = crossing(outline, peak, 1, half);
  pupil.middle = 0.5 * (rise + fall);
  pupil.fwhm = fall - rise;
  return std::isfinite(pupil.middle) && pupil.fwhm >= 1;
}

/// A bell's outline: of clipped samples, only those of the shortest exposure. A longer one was clipped at a level above
/// which that one still sees.
std::vector<float> outline_of(std::vector<float> gray, const FrameNoise& noise) {
  if (noise.mean_weight() == 1) return gray;
  for (int i = 0; i < static_cast<int>(gray.size()); ++i)
    if (float& sample = gray[static_cast<std::size_t>(i)];
        std::isinf(sample) && noise.at(i).ceiling < noise.highest_ceiling())
      sample = std::numeric_limits<float>::quiet_NaN();
  return gray;
}

/// All pixels of a sparse grid over one camera that show a bell in the frames before `end`.
std::vector<Pupil> find_pupils(const Frames& frames, int end, const FrameNoise& noise, std::size_t camera) {
  const int row_step = std::max(1, frames.height() / rows_looked_at);
  const int column_step = std::max(1, frames.width() / columns_looked_at);
  const int rows = (frames.height() + row_step - 1) / row_step;
  std::vector<std::vector<Pupil>> found(static_cast<std::size_t>(rows));
  parallel_rows(rows, [&](int r) {
    Image<float> samples(frames.width(), end);
    frames.read_row(r * row_step, 0, samples);
    const bool is_of_one_exposure = noise.mean_weight() == 1;
    Glance glance;
    if (is_of_one_exposure) glance.look(samples, column_step, static_cast<float>(noise.highest_ceiling()));
    for (int x = 0; x < frames.width(); x += column_step) {
      if (is_of_one_exposure && !glance.may_be_bell(static_cast<std::size_t>(x / column_step))) continue;
      Pupil pupil;
      pupil.camera = camera;
      pupil.gray.reserve(static_cast<std::size_t>(end));
      for (int i = 0; i < end; ++i) {
        pupil.gray.push_back(samples(x, i));
        if (!frames.is_even()) pupil.late.push_back(frames.late(i));
      }
      const std::vector<float> outline = outline_of(pupil.gray, noise);
      pupil.rank = mix((static_cast<std::uint64_t>(r * row_step) << 32) + static_cast<std::uint64_t>(x) +
                       0x9E3779B97F4A7C15ULL * (camera + 1));
      if (examine(pupil, outline, noise.highest_ceiling()))
        found[static_cast<std::size_t>(r)].push_back(std::move(pupil));
    }
  });
  std::vector<Pupil> pupils;
  for (auto& row : found) std::ranges::move(row, std::back_inserter(pupils));
  return pupils;
}

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
  for (const Pupil& pupil : pupils) amplitudes.push_back(pupil.bell.amplitude);
  const auto high = amplitudes.begin() + static_cast<std::ptrdiff_t>(amplitudes.size() * 19 / 20);
  std::nth_element(amplitudes.begin(), high, amplitudes.end());
  std::erase_if(pupils, [bright = 0.5 * *high](const Pupil& p) { return p.bell.amplitude < bright; });
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
  for (const Pupil& pupil : pupils) amplitudes.push_back(pupil.bell.amplitude);
  return median(amplitudes) > ceiling / 8;
}

/// Cuts a sequence to what surrounds the stripe.
void cut(Pupil& pupil, double reach) {
  const int count = static_cast<int>(pupil.gray.size());
  const int begin = std::clamp(static_cast<int>(std::floor(pupil.middle - reach)), 0, count);
  const int end = std::clamp(static_cast<int>(std::ceil(pupil.middle + reach)) + 1, begin, count);
  pupil.gray = {pupil.gray.begin() + begin, pupil.gray.begin() + end};
  if (!pupil.late.empty()) pupil.late = {pupil.late.begin() + begin, pupil.late.begin() + end};
  pupil.first_frame = begin;
}

/// Something bell-like to align with for the first time: a raised cosine.
StripeProfile raised_cosine(double fwhm) {
  std::vector<StripeProfile::Point> points;
  for (double t = -2 * fwhm; t <= 2 * fwhm; t += fwhm / 50)
    points.push_back({t, std::abs(t) < fwhm ? 0.5 + 0.5 * std::cos(std::numbers::pi * t / fwhm) : 0});
  return StripeProfile::fit(points, -1.5 * fwhm, 1.5 * fwhm, fwhm / 8);
}

class Teacher {
 public:
  Teacher(std::vector<Pupil> pupils, std::vector<FrameNoise> noise)
      : pupils_(std::move(pupils)), noise_(std::move(noise)) {
    fwhm_ = typical_width(pupils_);
    reach_ = widest_reach / 1.2 * fwhm_;
    learned_.profile = raised_cosine(fwhm_);
    only_flanks_ = std::ranges::all_of(pupils_, [](const Pupil& p) { return p.clipped; });
    for (Pupil& pupil : pupils_) {
      cut(pupil, 1.2 * reach_);
      pupil.bell.time = pupil.middle;
    }
  }

  LearnedStripe run() {
    const int iterations = number_of_iterations();
    for (int iteration = 0; iteration < iterations; ++iteration) {
      align(iteration);
      average(iteration + 2 >= iterations);
      if (iteration > 0) learn_noise();
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
        Bell start = iteration == 0 ? pupils_[i].bell : fits_[i].bell;
        start.width = 1;
        BellFitOptions options = common;
        options.late = pupils_[i].late;
        fits_[i] = fit_bell(pupils_[i].gray, pupils_[i].first_frame, learned_.profile, noise_[pupils_[i].camera], start,
                            options);
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
    const double bin_length = spacing / 4;
    std::vector<std::vector<StripeProfile::Point>> bins(
        static_cast<std::size_t>(std::ceil((end - begin) / bin_length)));
    const double limit = usual_misfit() * 2;
    for (std::size_t i = 0; i < pupils_.size(); ++i) {
      if (!fits_[i].converged || misfit(fits_[i]) > limit) continue;
      scatter(pupils_[i], fits_[i].bell, begin, bin_length, bins);
    }
    std::erase_if(bins, [](const auto& bin) { return bin.empty(); });
    std::vector<StripeProfile::Point> points(bins.size());
    parallel_ranges(static_cast<int>(bins.size()), 16, [&](int first, int last) {
      for (auto k = static_cast<std::size_t>(first); k < static_cast<std::size_t>(last); ++k)
        points[k] = robust_mean(bins[k]);
    });
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

  void scatter(const Pupil& pupil, const Bell& bell, double begin, double bin_length,
               std::vector<std::vector<StripeProfile::Point>>& bins) const {
    for (std::size_t k = 0; k < pupil.gray.size(); ++k) {
      const SensorNoise& noise = noise_[pupil.camera].at(pupil.first_frame + static_cast<int>(k));
      const double gray = pupil.gray[k], frame = pupil.time_of(k);
      const double model = bell.gray_at(frame, learned_.profile);
      // Close below the ceiling those samples are clipped whose noise is positive. To leave out whole moments, as the
      // model has them, and not single samples, as they came out, keeps the profile's tip from a bias.
      if (!std::isfinite(gray) || model > noise.ceiling - 3 * std::sqrt(noise.variance(model))) continue;
      const double time = (frame - bell.time) / bell.width;
      const double bin = (time - begin) / bin_length;
      if (bin < 0 || bin >= static_cast<double>(bins.size())) continue;
      const double weight = bell.amplitude * bell.amplitude / noise.variance(model);
      bins[static_cast<std::size_t>(bin)].push_back({time, (gray - bell.background) / bell.amplitude, weight});
    }
  }

  /// Mean of what is near the median: humps and glints of single pixels stay out.
  static StripeProfile::Point robust_mean(std::vector<StripeProfile::Point>& bin) {
    std::vector<double> values, deviations;
    for (const auto& point : bin) values.push_back(point.value);
    const double middle = median(values);
    for (const auto& point : bin) deviations.push_back(std::abs(point.value - middle));
    const double limit = 3 * 1.4826 * median(deviations) + 1e-6;
    StripeProfile::Point mean{0, 0, 0};
    for (const auto& point : bin) {
      if (std::abs(point.value - middle) > limit) continue;
      mean.time += point.weight * point.time;
      mean.value += point.weight * point.value;
      mean.weight += point.weight;
    }
    mean.time /= mean.weight;
    mean.value /= mean.weight;
    return mean;
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

  void learn_noise() {
    const double limit = usual_misfit() * 2;
    parallel_rows(static_cast<int>(noise_.size()), [&](int c) {
      const auto camera = static_cast<std::size_t>(c);
      std::vector<NoiseSample> samples;
      for (std::size_t i = 0; i < pupils_.size(); ++i)
        if (pupils_[i].camera == camera && fits_[i].converged && misfit(fits_[i]) <= limit)
          collect_noise(pupils_[i], fits_[i], samples);
      if (samples.empty()) return;
      SensorNoise noise = fit_sensor_noise(samples);
      noise.ceiling = noise_[camera].sensor().ceiling;
      noise_[camera] = noise_[camera].with(noise);
    });
  }

  /// As the sensor had them, whatever their exposure.
  void collect_noise(const Pupil& pupil, const BellFit& fit, std::vector<NoiseSample>& samples) const {
    for (std::size_t k = 0; k < pupil.gray.size(); ++k) {
      if (!std::isfinite(pupil.gray[k])) continue;
      const int frame = pupil.first_frame + static_cast<int>(k);
      const SensorNoise& noise = noise_[pupil.camera].at(frame);
      const double exposure = noise_[pupil.camera].exposure(frame);
      const double time = pupil.time_of(k);
      const Eigen::Vector4d gradient = bell_gradient(fit.bell, learned_.profile, time);
      const double model = fit.bell.amplitude * gradient(0) + fit.bell.background;
      if (model > noise.ceiling - 3 * std::sqrt(noise.variance(model))) continue;
      const double leverage = gradient.dot(fit.covariance.topLeftCorner<4, 4>() * gradient) / noise.variance(model);
      const double residual = exposure * (pupil.gray[k] - model);
      samples.push_back({exposure * model, residual * residual / std::max(0.2, 1 - leverage)});
    }
  }

  static constexpr double negligible = 0.003;

  std::vector<Pupil> pupils_;
  std::vector<FrameNoise> noise_;  ///< one a camera
  std::vector<BellFit> fits_;
  LearnedStripe learned_;
  double fwhm_ = 0;   ///< [frames]
  double reach_ = 0;  ///< [frames] before and after the middle within which the profile is looked for
  bool only_flanks_ = false;
};

}  // namespace

std::optional<LearnedStripe> learn_stripe_early(std::span<const Frames> cameras, int end, int most_pixels) {
  std::vector<Pupil> pupils;
  std::vector<FrameNoise> noise;
  const bool is_last = std::ranges::all_of(cameras, [end](const Frames& frames) { return end >= frames.count(); });
  const auto share = static_cast<std::size_t>(most_pixels) / std::max<std::size_t>(1, cameras.size());
  for (std::size_t camera = 0; camera < cameras.size(); ++camera) {
    const Lesson lesson{std::min(end, cameras[camera].count()), is_last};
    const SensorNoise first_guess{.ceiling = ceiling_of(cameras[camera])};
    noise.emplace_back(first_guess, cameras[camera].sequence().exposures);
    std::vector<Pupil> own = select(find_pupils(cameras[camera], lesson.end, noise.back(), camera), share, lesson);
    if (!is_last && !suffice(own, share, ceiling_of(cameras[camera]))) return std::nullopt;
    std::ranges::move(own, std::back_inserter(pupils));
  }
  if (pupils.empty()) throw no_result("no stripe of light passes in the frames: no pixel rises and falls once");
  return Teacher(std::move(pupils), std::move(noise)).run();
}

int next_lesson(int end) { return end < first_lesson ? first_lesson : end + end / 4; }

LearnedStripe learn_stripe(std::span<const Frames> cameras, int most_pixels) {
  int count = 0;
  for (const Frames& frames : cameras) count = std::max(count, frames.count());
  for (int end = next_lesson(0); end < count; end = next_lesson(end))
    if (auto learned = learn_stripe_early(cameras, end, most_pixels)) return *std::move(learned);
  return *learn_stripe_early(cameras, count, most_pixels);
}

}  // namespace pagesweep
