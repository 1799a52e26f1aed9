// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/sim/texture.h"

#include <algorithm>
#include <cmath>

namespace pagesweep::sim {
namespace {

/// Means of 2 x 2 pixels; an odd last row or column counts twice.
Image<float> halved(const Image<float>& image) {
  Image<float> half((image.width() + 1) / 2, (image.height() + 1) / 2);
  for (int y = 0; y < half.height(); ++y)
    for (int x = 0; x < half.width(); ++x) {
      const int right = std::min(2 * x + 1, image.width() - 1), below = std::min(2 * y + 1, image.height() - 1);
      half(x, y) = 0.25f * (image(2 * x, 2 * y) + image(right, 2 * y) + image(2 * x, below) + image(right, below));
    }
  return half;
}

}  // namespace

Texture::Texture(Image<float> albedo, double texels_per_mm) : texels_per_mm_(static_cast<float>(texels_per_mm)) {
  levels_.push_back(std::move(albedo));
  while (levels_.back().width() > 2 && levels_.back().height() > 2 && levels_.size() < 10)
    levels_.push_back(halved(levels_.back()));
}

int Texture::level_for(double footprint_mm) const {
  if (levels_.empty()) return 0;
  const double level = std::log2(footprint_mm * static_cast<double>(texels_per_mm_));
  return std::clamp(static_cast<int>(std::lround(level)), 0, static_cast<int>(levels_.size()) - 1);
}

float Texture::at(float s_mm, float t_mm, int level) const {
  if (levels_.empty()) return constant_;
  const Image<float>& image = levels_[static_cast<std::size_t>(level)];
  const float scale = texels_per_mm_ / static_cast<float>(1 << level);
  const float x = std::clamp(s_mm * scale - 0.5f, 0.0f, static_cast<float>(image.width() - 1));
  const float y = std::clamp(t_mm * scale - 0.5f, 0.0f, static_cast<float>(image.height() - 1));
  const int i = std::min(static_cast<int>(x), image.width() - 2), j = std::min(static_cast<int>(y), image.height() - 2);
  const float a = x - static_cast<float>(i), b = y - static_cast<float>(j);
  const float* above = image.data() + static_cast<std::size_t>(j) * static_cast<std::size_t>(image.width()) + i;
  const float* below = above + image.width();
  return (1 - b) * (above[0] + a * (above[1] - above[0])) + b * (below[0] + a * (below[1] - below[0]));
}

}  // namespace pagesweep::sim
