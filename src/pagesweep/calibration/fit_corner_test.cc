// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/calibration/fit_corner.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace pagesweep {
namespace {

constexpr double side_px = 24, blur_px = 0.8, black = 40, white = 180;

/// The picture of a corner between blurred edges, under light that gets brighter to the right.
Image<std::uint8_t> draw_corner(const CornerGuess& corner, double noise, unsigned seed, double gain = 1) {
  std::mt19937 random(seed);
  std::normal_distribution<double> error(0, noise);
  Image<std::uint8_t> image(64, 64);
  const auto edge = [&](const Eigen::Vector2d& along, const Eigen::Vector2d& d) {
    const Eigen::Vector2d u = along.normalized();
    return std::erf((u.x() * d.y() - u.y() * d.x()) / (std::numbers::sqrt2 * blur_px));
  };
  for (int y = 0; y < 64; ++y)
    for (int x = 0; x < 64; ++x) {
      const Eigen::Vector2d d = Eigen::Vector2d(x, y) - corner.pixel;
      const double sign = (corner.upper_right_is_black ? 1 : -1) * edge(corner.right_px, d) * edge(corner.up_px, d);
      const double light = gain * (1 + 0.003 * d.x());
      const double gray =
          light * (0.5 * (white + black) + 0.5 * (white - black) * sign) + (noise > 0 ? error(random) : 0);
      image(x, y) = static_cast<std::uint8_t>(std::clamp(std::lround(gray), 0L, 255L));
    }
  return image;
}

CornerGuess some_corner() {
  CornerGuess corner;
  corner.pixel = {31.37, 30.81};
  corner.right_px = side_px * Eigen::Vector2d(std::cos(0.2), std::sin(0.2));
  corner.up_px = 0.8 * side_px * Eigen::Vector2d(std::sin(0.3), -std::cos(0.3));
  corner.upper_right_is_black = true;
  corner.margin = 0.13;
  return corner;
}

CornerGuess moved(CornerGuess corner, double dx, double dy) {
  corner.pixel += Eigen::Vector2d(dx, dy);
  return corner;
}

TEST(FitCorner, FindsACornerToTheResolutionOfTheGrayValues) {
  const CornerGuess corner = some_corner();
  const auto fit = fit_corner(draw_corner(corner, 0, 0).view(), moved(corner, 1.3, -0.9));
  ASSERT_TRUE(fit);
  // Rounding to whole gray values is noise of 1/sqrt(12); see below for what that does.
  EXPECT_LT((fit->pixel - corner.pixel).norm(), 0.003);
  EXPECT_NEAR(fit->blur_px, blur_px, 0.01);
  EXPECT_NEAR(fit->contrast, white - black, 1);
}

TEST(FitCorner, NoiseCostsLittleMoreThanTheEdgesAllow) {
  // Along an edge of length L with contrast a and noise n, its position across has the Cramer-Rao bound
  // n sqrt(2 sqrt(pi) s / L) / a: the integral of a squared Gaussian slope is a^2 / (2 sqrt(pi) s).
  const CornerGuess corner = some_corner();
  const double noise = 3;
  double squares = 0;
  constexpr int trials = 200;
  for (unsigned seed = 1; seed <= trials; ++seed) {
    const auto fit = fit_corner(draw_corner(corner, noise, seed).view(), moved(corner, 0.4, 0.3));
    ASSERT_TRUE(fit);
    squares += (fit->pixel - corner.pixel).squaredNorm();
  }
  const auto bound = [&](double square_px) {
    const double length = 0.9 * square_px;  // followed 0.45 squares to both sides
    return noise / (white - black) * std::sqrt(2 * std::sqrt(std::numbers::pi) * blur_px / length);
  };
  // The edges are not quite at right angles, so errors along them add: 1 / sin^2 of the angle between them.
  const double sine = std::sin(std::numbers::pi / 2 + 0.2 - 0.3);
  const double expected = std::hypot(bound(side_px), bound(0.8 * side_px)) / sine;
  // Levels, blur and the light's slope have to be found too, from the same narrow strips.
  EXPECT_LT(std::sqrt(squares / trials), 1.7 * expected);
  EXPECT_GT(std::sqrt(squares / trials), 0.8 * expected);
}

TEST(FitCorner, OverexposureIsToldAndDoesNotMoveTheCorner) {
  const CornerGuess corner = some_corner();
  const auto fit = fit_corner(draw_corner(corner, 0, 0, 1.8).view(), corner);
  ASSERT_TRUE(fit);
  EXPECT_GT(fit->clipped, 0.5);
  EXPECT_LT((fit->pixel - corner.pixel).norm(), 0.01);
}

TEST(FitCorner, WhatIsNoSuchCornerIsNotFound) {
  const CornerGuess corner = some_corner();
  const Image<std::uint8_t> image = draw_corner(corner, 0, 0);
  CornerGuess other = corner;
  other.upper_right_is_black = false;
  EXPECT_FALSE(fit_corner(image.view(), other)) << "of the other colour";
  EXPECT_FALSE(fit_corner(image.view(), moved(corner, 0, 26))) << "half outside the picture";
  EXPECT_FALSE(fit_corner(Image<std::uint8_t>(64, 64, 90).view(), corner)) << "nothing there";
  EXPECT_FALSE(fit_corner(image.view(), moved(corner, std::nan(""), 0)));
  CornerGuess flat = corner;
  flat.up_px = flat.right_px;
  EXPECT_FALSE(fit_corner(image.view(), flat));
}

}  // namespace
}  // namespace pagesweep
