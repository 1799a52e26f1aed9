// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string_view>
#include <vector>

#include "pagesweep/base/enum_names.h"

namespace pagesweep::sim {

enum class StripeShape {
  gaussian,
  flat_top,  ///< a plateau with soft edges: a box convolved with a Gaussian
  skewed,    ///< a Gaussian convolved with a decaying exponential: steep in front, with a tail behind
};

constexpr auto names_of(StripeShape) { return std::array<std::string_view, 3>{"gaussian", "flat-top", "skewed"}; }

/// Light of the stripe across its width, highest value 1. Position 0 is the stripe's middle: where a gaussian and a
/// flat top are symmetric, and the centre of mass of a skewed one.
class Stripe {
 public:
  /// \param softness  flat_top: length of an edge over the half width; skewed: length of the tail over the width of the
  ///                  Gaussian. 0.1 to 3; a gaussian has none
  Stripe(StripeShape shape, double fwhm_mm, double softness);

  double first_mm() const { return first_mm_; }  ///< the light is 0 before
  double last_mm() const { return -first_mm_; }  ///< and after
  /// Linear interpolation of a fine table.
  float light(float position_mm) const {
    const float position = (position_mm - static_cast<float>(first_mm_)) * static_cast<float>(samples_per_mm_);
    const int i = static_cast<int>(position);
    if (position < 0 || i >= cells) return 0;
    const float* sample = samples_.data() + i;
    return sample[0] + (position - static_cast<float>(i)) * (sample[1] - sample[0]);
  }

 private:
  static constexpr int cells = 8192;
  double first_mm_;
  double samples_per_mm_;
  std::vector<float> samples_;
};

}  // namespace pagesweep::sim
