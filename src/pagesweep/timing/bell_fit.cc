// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/bell_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "pagesweep/timing/mills_ratio_internal.h"

namespace pagesweep {
namespace {

/// Sums over all samples for one Gauss-Newton step in N unknowns.
template <int N>
struct Step {
  Eigen::Matrix<double, N, N> information = Eigen::Matrix<double, N, N>::Zero();
  Eigen::Matrix<double, N, 1> gradient = Eigen::Matrix<double, N, 1>::Zero();
  double chi_square = 0;
  int samples = 0;

  void add(const double (&j)[N], double weight, double pull) {
    for (int r = 0; r < N; ++r) {
      gradient(r) += pull * j[r];
      for (int c = 0; c <= r; ++c) information(r, c) += weight * j[r] * j[c];
    }
  }
};

/// N = 3, 4 or 5 unknowns stand for BellUnknowns basic, width, curved_background.
template <int N>
class Fitter {
 public:
  Fitter(std::span<const float> gray, int first_frame, const StripeProfile& profile, const FrameNoise& noise,
         const Bell& start, const BellFitOptions& options)
      : gray_(gray), first_frame_(first_frame), profile_(profile), noise_(noise), start_(start), options_(options) {}

  BellFit run() {
    BellFit fit;
    fit.bell = start_;
    fit.unknowns = N;
    const double longest_step = 0.3 * profile_.full_width_half_maximum() * start_.width;
    for (int iteration = 0; iteration < options_.most_iterations && !fit.converged; ++iteration) {
      const Step<N> step = sum(fit.bell);
      const Eigen::LDLT<Eigen::Matrix<double, N, N>, Eigen::Lower> solver(step.information);
      const Eigen::Matrix<double, N, 1> change = solver.solve(step.gradient);
      if (!change.allFinite()) return fit;
      const double sigma = move(fit, change, longest_step, solver);
      // The error that a last step of this size leaves is of second order: far below a hundredth of sigma.
      fit.converged = iteration > 0 && std::abs(change(2)) < std::max(0.03 * sigma, 1e-7) &&
                      std::abs(change(0)) <= 0.01 * fit.bell.amplitude;
      fit.chi_square = step.chi_square;
      fit.samples = step.samples;
    }
    return fit;
  }

 private:
  Step<N> sum(const Bell& bell) const {
    Step<N> step;
    const double per_width = 1 / bell.width;
    for (std::size_t k = 0; k < gray_.size(); ++k) {
      const double gray = gray_[k];
      if (std::isnan(gray)) continue;
      const double late = options_.late.empty() ? 0 : static_cast<double>(options_.late[k]);
      const double after = first_frame_ + static_cast<double>(k) + late - bell.time;
      const double t = after * per_width;
      const auto [value, slope] = profile_.at(t);
      double model = bell.amplitude * value + bell.background;
      double j[N];
      j[0] = value;
      j[1] = 1;
      j[2] = -bell.amplitude * slope * per_width;
      if constexpr (N == 4) j[3] = -bell.amplitude * slope * t;
      if constexpr (N == 5) {
        model += after * (bell.slope + after * bell.curvature);
        j[3] = after;
        j[4] = after * after;
      }
      const SensorNoise& noise = noise_.at(first_frame_ + static_cast<int>(k));
      const double precision = 1 / noise.variance(model);
      if (std::isinf(gray)) {
        add_clipped(step, j, model - noise.ceiling, precision);
        continue;
      }
      const double residual = gray - model;
      step.add(j, precision, precision * residual);
      step.chi_square += precision * residual * residual;
      ++step.samples;
    }
    if constexpr (N == 4) {
      const double prior = 1 / (options_.log_width_sigma * options_.log_width_sigma);
      step.information(3, 3) += prior;
      step.gradient(3) -= prior * std::log(bell.width / start_.width);
    }
    return step;
  }

  /// \param excess  of the model over the ceiling [gray values]
  static void add_clipped(Step<N>& step, const double (&j)[N], double excess, double precision) {
    const double root = std::sqrt(precision);
    const double z = excess * root;
    if (z > 5) return;  // it had to be clipped and tells nothing
    const double ratio = inverse_mills_ratio(z);
    step.add(j, ratio * (ratio + z) * precision, ratio * root);
  }

  /// Applies a step, held within its limits, and sets the covariance. \return standard deviation of the time
  double move(BellFit& fit, const Eigen::Matrix<double, N, 1>& change, double longest_step,
              const Eigen::LDLT<Eigen::Matrix<double, N, N>, Eigen::Lower>& solver) const {
    Bell& bell = fit.bell;
    bell.amplitude = std::max(bell.amplitude + change(0), 0.3 * bell.amplitude);
    bell.background += change(1);
    bell.time += std::clamp(change(2), -longest_step, longest_step);
    if constexpr (N == 4) bell.width *= std::exp(std::clamp(change(3), -0.3, 0.3));
    if constexpr (N == 5) {
      bell.slope += change(3);
      bell.curvature += change(4);
    }
    const Eigen::Matrix<double, N, N> covariance = solver.solve(Eigen::Matrix<double, N, N>::Identity());
    fit.covariance.template topLeftCorner<N, N>() = covariance;
    return std::sqrt(std::max(0.0, covariance(2, 2)));
  }

  std::span<const float> gray_;
  int first_frame_;
  const StripeProfile& profile_;
  const FrameNoise& noise_;
  const Bell start_;
  const BellFitOptions& options_;
};

}  // namespace

BellFit fit_bell(std::span<const float> gray, int first_frame, const StripeProfile& profile, const FrameNoise& noise,
                 const Bell& start, const BellFitOptions& options) {
  switch (options.unknowns) {
    case BellUnknowns::width:
      return Fitter<4>(gray, first_frame, profile, noise, start, options).run();
    case BellUnknowns::curved_background:
      return Fitter<5>(gray, first_frame, profile, noise, start, options).run();
    case BellUnknowns::basic:
      break;
  }
  return Fitter<3>(gray, first_frame, profile, noise, start, options).run();
}

Eigen::Vector4d bell_gradient(const Bell& bell, const StripeProfile& profile, double frame) {
  const double t = (frame - bell.time) / bell.width;
  const auto [value, slope] = profile.at(t);
  return {value, 1, -bell.amplitude * slope / bell.width, -bell.amplitude * slope * t};
}

}  // namespace pagesweep
