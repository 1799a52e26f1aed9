// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/drift/align_patch.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <random>

namespace pagesweep {
namespace {

/// Something like print: waves of 6 px and more, in all directions.
float print_at(double x, double y) {
  double value = 100;
  for (int k = 1; k <= 16; ++k) {
    const double angle = 2.4 * k, length = 0.3 + 0.7 * std::fmod(0.618 * k, 1.0);
    value += 12 * std::sin(length * (x * std::cos(angle) + y * std::sin(angle)) + 1.7 * k);
  }
  return static_cast<float>(value);
}

/// A patch of 32 x 32 pixels and the picture in which it lies `shift` from where it is expected.
struct Pair {
  Image<float> other{80, 80};
  Patch patch;
  explicit Pair(const Eigen::Vector2d& shift, double noise = 0, unsigned seed = 1) {
    std::mt19937 random(seed);
    std::normal_distribution<float> scatter(0, static_cast<float>(noise > 0 ? noise : 1));
    const auto noisy = [&](float value) { return noise > 0 ? value + scatter(random) : value; };
    for (int y = 0; y < 80; ++y)
      for (int x = 0; x < 80; ++x) other(x, y) = noisy(0.8F * print_at(x - shift.x(), y - shift.y()) + 0.2F * y);
    for (int y = 24; y < 56; ++y)
      for (int x = 24; x < 56; ++x) {
        patch.gray.push_back(noisy(print_at(x, y)));
        patch.offset.push_back({(x - 40) / 16.0, (y - 40) / 16.0});
        patch.place.push_back({x, y});
      }
  }
};

const ShiftRange in_the_plane{Eigen::Matrix2d::Identity(), 6, 1};

TEST(AlignPatch, FindsShiftsOfPartsOfAPixel) {
  for (const Eigen::Vector2d& shift : {Eigen::Vector2d(0, 0), {2.3, -1.7}, {-4.4, 3.25}}) {
    const Pair pair(shift);
    const auto found = align_patch(pair.other, pair.patch, in_the_plane);
    ASSERT_TRUE(found);
    // Bilinear interpolation dampens waves, and does not move them.
    EXPECT_NEAR((found->amount - shift).norm(), 0, 0.02);
    EXPECT_GT(found->correlation, 0.98);
  }
}

TEST(AlignPatch, FindsShiftsAlongOneDirection) {
  const Eigen::Vector2d direction(0.6, -0.8);
  const Pair pair(2.6 * direction);
  const auto found = align_patch(pair.other, pair.patch, {direction, 5, 0.5});
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->amount(0), 2.6, 0.02);
}

TEST(AlignPatch, KnowsHowWellItKnows) {
  double normalised = 0;
  constexpr int runs = 60;
  for (unsigned seed = 0; seed < runs; ++seed) {
    const Pair pair({1.4, -0.6}, 12, seed);
    const auto found = align_patch(pair.other, pair.patch, in_the_plane);
    ASSERT_TRUE(found);
    const Eigen::Vector2d error = found->amount - Eigen::Vector2d(1.4, -0.6);
    normalised += error.dot(found->covariance.inverse() * error) / (2 * runs);
  }
  // The sharing of pixels between samples is allowed for by a round number; the noise in the patch itself is not told
  // from that of the picture. Within a factor of two in the standard deviation.
  EXPECT_GT(normalised, 0.25);
  EXPECT_LT(normalised, 4);
}

TEST(AlignPatch, RefusesWhatCannotBeTold) {
  Pair flat({1, 1});
  for (float& gray : flat.other.pixels()) gray = 50;
  EXPECT_FALSE(align_patch(flat.other, flat.patch, in_the_plane)) << "no print";

  Pair striped({0, 0});
  for (int y = 0; y < 80; ++y)
    for (int x = 0; x < 80; ++x) striped.other(x, y) = static_cast<float>(100 + 50 * std::sin(2 * x));
  for (std::size_t i = 0; i < striped.patch.gray.size(); ++i)
    striped.patch.gray[i] = static_cast<float>(100 + 50 * std::sin(2 * striped.patch.place[i].x()));
  EXPECT_FALSE(align_patch(striped.other, striped.patch, in_the_plane)) << "the same every 3 px, and along the stripes";

  const Pair far({9, 0});
  EXPECT_FALSE(align_patch(far.other, far.patch, in_the_plane)) << "beyond the range";
}

TEST(AlignPatch, SamplesOnlyWhatIsThere) {
  Image<float> image(3, 2);
  for (int y = 0; y < 2; ++y)
    for (int x = 0; x < 3; ++x) image(x, y) = static_cast<float>(x + 10 * y);
  EXPECT_FLOAT_EQ(sample(image, {1.25, 0.5}), 6.25F);
  EXPECT_FLOAT_EQ(sample(image, {2, 1}), 12);
  EXPECT_TRUE(std::isnan(sample(image, {2.01, 0})));
  EXPECT_TRUE(std::isnan(sample(image, {0, -0.01})));
  EXPECT_TRUE(std::isnan(sample(Image<float>(1, 1), {0, 0}))) << "nothing to interpolate between";
}

}  // namespace
}  // namespace pagesweep
