// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <span>

#include "pagesweep/timing/sensor_noise.h"
#include "pagesweep/timing/stripe_profile.h"

namespace pagesweep {

/// The stripe as one pixel sees it: gray(t) = amplitude profile((t - time) / width) + background
/// + slope (t - time) + curvature (t - time)^2. The last two are 0 unless the background is fitted as curved.
struct Bell {
  double amplitude = 0;   ///< [gray values]
  double background = 0;  ///< [gray values]
  double time = 0;        ///< [frames]
  double width = 1;       ///< of the stripe here, relative to the profile's
  double slope = 0;       ///< [gray values / frame]
  double curvature = 0;   ///< [gray values / frame^2]

  double background_at(double frame) const {
    const double t = frame - time;
    return background + t * (slope + t * curvature);
  }
  double gray_at(double frame, const StripeProfile& profile) const {
    return amplitude * profile.value((frame - time) / width) + background_at(frame);
  }
};

/// What is unknown besides amplitude, background and time.
enum class BellUnknowns {
  basic,              ///< nothing
  width,              ///< the log width, known beforehand to log_width_sigma
  curved_background,  ///< slope and curvature of the background: light from elsewhere that changes while the stripe
                      ///< passes
};

struct BellFitOptions {
  BellUnknowns unknowns = BellUnknowns::basic;
  double log_width_sigma = 0.2;      ///< standard deviation of log width around the start value
  int most_iterations = 12;          ///< after 1, the covariance is that of the start values
  std::span<const float> late = {};  ///< [frames] by which each sample was exposed later than its frame; empty: 0
};

struct BellFit {
  Bell bell;
  /// Of (amplitude, background, time), then (log width) or (slope, curvature), from the Fisher information; else 0.
  Eigen::Matrix<double, 5, 5> covariance = Eigen::Matrix<double, 5, 5>::Zero();
  int unknowns = 3;
  double chi_square = 0;  ///< sum of squared residuals over their variances, unclipped samples
  int samples = 0;        ///< unclipped samples that took part
  bool converged = false;

  double time_sigma() const { return std::sqrt(covariance(2, 2)); }  ///< [frames]
  double log_width_sigma() const { return std::sqrt(covariance(3, 3)); }
  double reduced_chi_square() const { return chi_square / std::max(1, samples - unknowns); }  ///< 1: the model holds
};

/// Maximum likelihood estimate of a bell: Gauss-Newton steps on
///     sum over samples (gray_i - model_i)^2 / variance_i(model_i)  +  clipped samples as "at least ceiling_i",
/// the variances renewed from the model at every step, so that noise does not choose its own weight. A clipped sample
/// contributes log Phi((model - ceiling) / sigma) (Tobin 1958): nothing where the model is far above the ceiling,
/// and near it what keeps the neighbouring samples, unclipped by luck, from a bias.
/// \param gray         consecutive samples; NaN: dropped, +infinity: clipped
/// \param first_frame  time of gray[0]
/// \param noise        of the frames
/// \param start        within about half a stripe's width of the truth
BellFit fit_bell(std::span<const float> gray, int first_frame, const StripeProfile& profile, const FrameNoise& noise,
                 const Bell& start, const BellFitOptions& options = {});

/// d gray / d (amplitude, background, time, log width) at a frame, for a bell on an even background.
Eigen::Vector4d bell_gradient(const Bell& bell, const StripeProfile& profile, double frame);

}  // namespace pagesweep
