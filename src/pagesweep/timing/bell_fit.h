// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>

#include "pagesweep/timing/sensor_noise.h"
#include "pagesweep/timing/stripe_profile.h"

namespace pagesweep {

/// The stripe as one pixel sees it: gray(t) = amplitude profile((t - time) / width) + background.
struct Bell {
  double amplitude = 0;   ///< [gray values]
  double background = 0;  ///< [gray values]
  double time = 0;        ///< [frames]
  double width = 1;       ///< of the stripe here, relative to the profile's
};

struct BellFitOptions {
  bool fit_width = false;        ///< the width is unknown too, known beforehand to log_width_sigma
  double log_width_sigma = 0.2;  ///< standard deviation of log width around the start value
  bool robust = false;           ///< samples that the bell does not explain lose their weight (Tukey's biweight)
  int most_iterations = 12;
};

struct BellFit {
  Bell bell;
  /// Of (amplitude, background, time, log width), from the Fisher information; 0 for a width that was not fitted.
  Eigen::Matrix4d covariance = Eigen::Matrix4d::Zero();
  double chi_square = 0;  ///< sum of squared residuals over their variances, unclipped samples
  int samples = 0;        ///< unclipped samples that took part
  bool converged = false;

  double time_sigma() const;          ///< [frames]
  double reduced_chi_square() const;  ///< 1 where the model holds
};

/// Maximum likelihood estimate of a bell: Gauss-Newton steps on
///     sum over samples (gray_i - model_i)^2 / variance(model_i)  +  clipped samples as "at least noise.ceiling",
/// the variances renewed from the model at every step, so that noise does not choose its own weight. A clipped sample
/// contributes log Phi((model - ceiling) / sigma) (Tobin 1958): nothing where the model is far above the ceiling,
/// and near it what keeps the neighbouring samples, unclipped by luck, from a bias.
/// \param gray         consecutive samples; NaN: dropped, +infinity: clipped
/// \param first_frame  time of gray[0]
/// \param start        within about half a stripe's width of the truth
BellFit fit_bell(std::span<const float> gray, int first_frame, const StripeProfile& profile, const SensorNoise& noise,
                 const Bell& start, const BellFitOptions& options = {});

/// Row of the Jacobian: d model / d (amplitude, background, time, log width) at a time.
Eigen::Vector4d bell_gradient(const Bell& bell, const StripeProfile& profile, double time);

}  // namespace pagesweep
