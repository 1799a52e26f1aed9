// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <limits>
#include <span>
#include <vector>

namespace pagesweep {

/// How a sensor's samples scatter (EMVA 1288's linear camera): variance = read noise + gain * light, the second term
/// being the photons' own shot noise. Gray values are without the black level.
struct SensorNoise {
  double read_variance = 1;                                  ///< [gray values^2] without light, quantisation included
  double gain = 0;                                           ///< [gray values] a photoelectron
  double ceiling = std::numeric_limits<double>::infinity();  ///< [gray values] a sample is clipped from here on

  double variance(double gray) const { return gray > 0 ? read_variance + gain * gray : read_variance; }
};

/// The noise of each frame's samples when they are divided by the frame's relative exposure e, as Frames::read_row()
/// does. A sensor's g = e s of variance read + gain g and ceiling c becomes s of variance read / e^2 + gain / e s and
/// ceiling c / e: of the same form, so that a frame's noise is a SensorNoise again.
class FrameNoise {
 public:
  /// \param exposures  one a frame, the longest 1; empty: all alike. See Sequence::exposures
  FrameNoise(const SensorNoise& sensor, std::vector<double> exposures = {});  // NOLINT(*-explicit-*): the usual case

  /// Of gray values as the sensor has them, which are those of the longest exposure.
  const SensorNoise& sensor() const { return sensor_; }
  const SensorNoise& at(int frame) const {
    return frames_.empty() ? sensor_ : frames_[static_cast<std::size_t>(frame)];
  }
  double exposure(int frame) const { return exposures_.empty() ? 1 : exposures_[static_cast<std::size_t>(frame)]; }
  /// What a frame's sample counts against noise that does not grow with light: the square of its exposure.
  double weight(int frame) const { return exposure(frame) * exposure(frame); }
  double mean_weight() const { return mean_weight_; }
  double highest_ceiling() const { return highest_ceiling_; }  ///< that of the shortest exposure
  FrameNoise with(const SensorNoise& sensor) const { return {sensor, exposures_}; }

 private:
  SensorNoise sensor_;
  std::vector<double> exposures_;
  std::vector<SensorNoise> frames_;
  double mean_weight_ = 1;
  double highest_ceiling_;
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
