// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "pagesweep/base/image.h"

namespace pagesweep::sim {

/// The albedo of a surface over its (s, t): bilinear between texels, with levels of half the resolution each for rays
/// whose footprint is larger than a texel.
class Texture {
 public:
  Texture() = default;
  explicit Texture(float albedo) : constant_(albedo) {}
  /// \param albedo  texel (i, j) is centred at s = (i + 0.5) / texels_per_mm, t = (j + 0.5) / texels_per_mm
  Texture(Image<float> albedo, double texels_per_mm);

  bool is_constant() const { return levels_.empty(); }
  /// The level whose texels are about as large as a footprint.
  int level_for(double footprint_mm) const;
  float at(float s_mm, float t_mm, int level) const;

 private:
  float constant_ = 0;
  float texels_per_mm_ = 0;
  std::vector<Image<float>> levels_;  ///< empty: constant
};

}  // namespace pagesweep::sim
