// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

namespace pagesweep {

/// One sample of a pixel's bell A p(i - t) + b: p, highest value 1, and its slope.
struct BellSample {
  double light = 0;     ///< p(i - t)
  double slope = 0;     ///< p'(i - t) [1/frame]
  double exposure = 1;  ///< of its frame, relative to that for which the amplitude is meant
};

/// Noise of one sample as the sensor has it, after EMVA 1288's linear camera: its variance is shot_gray * (gray value)
/// + read + rounding.
struct SampleNoise {
  double shot_gray = 0;                 ///< [gray values] variance a gray value: 1 / (electrons a gray value)
  double read_variance = 0;             ///< [gray values^2]
  double rounding_variance = 1.0 / 12;  ///< [gray values^2] of whole gray values
  double clips_at_gray = 255;           ///< first gray value above black that is clipped: such samples say nothing
};

/// A variance and what it is made of.
struct TimeVariance {
  double shot = 0;      ///< [frames^2] photon noise
  double read = 0;      ///< [frames^2] noise of the sensor in the dark
  double rounding = 0;  ///< [frames^2] whole gray values

  double total() const { return shot + read + rounding; }
};

/// The Cramér-Rao bound of t for an estimator that knows p but neither amplitude A nor background b: the first diagonal
/// element of F^-1, F = sum g g^T / variance, g = (-A p', p, 1) (docs/derivations/accuracy.md).
///
/// An estimator that reaches it is linear in the noise with weights w_k = (F^-1 g_k)_1 / variance_k, so that the bound
/// is the sum of w_k^2 variance_k, and each kind of noise has its share.
/// \return  infinity where the samples do not determine t
TimeVariance time_variance(std::span<const BellSample> bell, double amplitude_gray, const SampleNoise& noise);

}  // namespace pagesweep
