// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>
#include <span>

namespace pagesweep {

/// How a sensor's samples scatter (EMVA 1288's linear camera): variance = read noise + gain * light, the second term
/// being the photons' own shot noise. Gray values are without the black level.
struct SensorNoise {
  double read_variance = 1;                                  ///< [gray values^2] without light, quantisation included
  double gain = 0;                                           ///< [gray values] a photoelectron
  double ceiling = std::numeric_limits<double>::infinity();  ///< [gray values] a sample is clipped from here on

  double variance(double gray) const { return gray > 0 ? read_variance + gain * gray : read_variance; }
};

/// Rounding to whole gray values scatters by this much, however silent the sensor is.
inline constexpr double quantisation_variance = 1.0 / 12;

/// What a fit left over at one sample.
struct NoiseSample {
  double gray = 0;              ///< [gray values] of the fitted model
  double squared_residual = 0;  ///< [gray values^2], divided by 1 - leverage: its expectation is the variance
};

/// Read variance and gain from residuals at many gray values: a straight line through robust variances of bins, neither
/// part negative, the first at least quantisation_variance.
/// \return ceiling is left at infinity; all defaults if there are fewer than 50 samples
SensorNoise fit_sensor_noise(std::span<const NoiseSample> samples);

}  // namespace pagesweep
