// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <variant>
#include <vector>

#include "pagesweep/data/picture.h"

namespace pagesweep {

/// How a picture's samples encode light: by the first tone curve of its ICC profile (kTRC, rTRC; 'curv' or 'para'), or
/// by sRGB's (IEC 61966-2-1) if it has no profile, or one that is not made of such curves. Samples and light are shares
/// of white, 0 to 1.
class TransferCurve {
 public:
  TransferCurve();  ///< sRGB
  static TransferCurve of(const Picture& picture);

  double light(double sample) const;
  double sample(double light) const;
  /// Light of one sample of a pixel.
  float light_of(const Picture& picture, int x, int y, int channel) const;
  /// Light of every sample that 8 or 16 bit can hold.
  std::vector<float> table(int bit_depth) const;

 private:
  explicit TransferCurve(std::vector<double> lights) : lights_(std::move(lights)) {}
  std::vector<double> lights_;  ///< at evenly spaced samples from 0 to 1, never falling
};

}  // namespace pagesweep
