// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/planning/time_variance.h"

#include <Eigen/Core>
#include <Eigen/LU>
#include <limits>

namespace pagesweep {

TimeVariance time_variance(std::span<const BellSample> bell, double amplitude_gray, const SampleNoise& noise) {
  const double constant = noise.read_variance + noise.rounding_variance;
  const auto gray = [&](const BellSample& sample) { return sample.exposure * amplitude_gray * sample.light; };
  const auto gradient = [&](const BellSample& sample) -> Eigen::Vector3d {  // by t, A, b
    return sample.exposure * Eigen::Vector3d(-amplitude_gray * sample.slope, sample.light, 1);
  };
  const auto variance = [&](const BellSample& sample) { return noise.shot_gray * gray(sample) + constant; };
  const auto is_clipped = [&](const BellSample& sample) { return gray(sample) >= noise.clips_at_gray; };

  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  for (const BellSample& sample : bell)
    if (!is_clipped(sample)) information += gradient(sample) * gradient(sample).transpose() / variance(sample);
  // Amplitude and time have other units: the rank shows when both are scaled to an information of 1.
  const Eigen::Vector3d scale = information.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  Eigen::FullPivLU<Eigen::Matrix3d> factors(scale.asDiagonal() * information * scale.asDiagonal());
  factors.setThreshold(1e-9);
  TimeVariance result;
  if (!factors.isInvertible()) {
    result.shot = std::numeric_limits<double>::infinity();
    return result;
  }
  const Eigen::Vector3d by_time = scale(0) * scale.asDiagonal() * factors.inverse().col(0);  // symmetric
  for (const BellSample& sample : bell) {
    if (is_clipped(sample)) continue;
    const double weight = by_time.dot(gradient(sample)) / variance(sample);
    result.shot += weight * weight * (variance(sample) - constant);
    result.read += weight * weight * noise.read_variance;
    result.rounding += weight * weight * noise.rounding_variance;
  }
  return result;
}

}  // namespace pagesweep
