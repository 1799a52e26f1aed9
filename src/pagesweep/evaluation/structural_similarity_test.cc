// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/evaluation/structural_similarity.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace pagesweep {
namespace {

/// Something like lines of print: dark bars on white paper.
Image<float> bars(double shift_px = 0) {
  Image<float> image(256, 192);
  for (int y = 0; y < image.height(); ++y)
    for (int x = 0; x < image.width(); ++x)
      image(x, y) = static_cast<float>(140 + 90 * std::tanh(3 * std::sin((x - shift_px) * 0.5) * std::sin(0.2 * y)));
  return image;
}

Image<float> with_noise(Image<float> image, float sigma) {
  std::mt19937 random(1);
  std::normal_distribution<float> noise(0, sigma);
  for (float& value : image.pixels()) value += noise(random);
  return image;
}

double compare(const Image<float>& a, const Image<float>& b) { return ms_ssim(a.view(), b.view()); }

TEST(MsSsim, IsOneForEqualPicturesOnly) {
  EXPECT_NEAR(compare(bars(), bars()), 1, 1e-6);
  EXPECT_LT(compare(bars(), bars(1)), 0.99);
}

TEST(MsSsim, FallsWithDistanceAndWithNoise) {
  EXPECT_GT(compare(bars(), bars(0.3)), compare(bars(), bars(0.6)));
  EXPECT_GT(compare(bars(), bars(0.6)), compare(bars(), bars(1.2)));
  EXPECT_GT(compare(bars(), with_noise(bars(), 3)), compare(bars(), with_noise(bars(), 12)));
}

TEST(MsSsim, DoesNotDependOnTheOrder) {
  EXPECT_NEAR(compare(bars(), with_noise(bars(), 9)), compare(with_noise(bars(), 9), bars()),
              1e-6);  // single precision
}

/// Constant pictures of levels p and q have structure terms 1 and the luminance term of the definition, at the coarsest
/// scale alone.
TEST(MsSsim, OfConstantPicturesIsThePapersLuminanceTerm) {
  Image<float> dark(180, 180, 100.0F), bright(180, 180, 120.0F);
  const double c1 = 2.55 * 2.55, luminance = (2 * 100 * 120 + c1) / (100 * 100 + 120 * 120 + c1);
  EXPECT_NEAR(compare(dark, bright), std::pow(luminance, 0.1333), 1e-4);
}

TEST(MsSsim, SaysNothingOfPicturesWithoutAWindowAtTheCoarsestScale) {
  EXPECT_TRUE(std::isnan(compare(Image<float>(175, 300, 1.0F), Image<float>(175, 300, 1.0F))));
}

}  // namespace
}  // namespace pagesweep
