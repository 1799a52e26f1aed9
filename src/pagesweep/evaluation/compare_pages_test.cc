// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/evaluation/compare_pages.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "pagesweep/evaluation/scan_map_inverse.h"

namespace pagesweep {
namespace {

using Place = std::function<Eigen::Vector2d(const Eigen::Vector2d&)>;

/// Where the scan shows a spot of paper [mm -> px]: squeezed towards the gutter at the left, slightly turned.
Eigen::Vector2d scan_of(const Eigen::Vector2d& paper) {
  const double x = paper.x() - 6 * std::exp(-paper.x() / 20);
  return {200 + 6 * (x + 0.02 * paper.y()), 100 + 6 * (paper.y() - 0.02 * x)};
}

/// The map of a page on which `paper_of` tells what spot of paper lies where [mm].
ScanMap map_of(double width_mm, double height_mm, double pixels_per_mm, const Place& paper_of) {
  ScanMap map(static_cast<int>(width_mm * pixels_per_mm), static_cast<int>(height_mm * pixels_per_mm));
  for (int y = 0; y < map.height(); ++y)
    for (int x = 0; x < map.width(); ++x) {
      const Eigen::Vector2d scan = scan_of(paper_of(Eigen::Vector2d(x + 0.5, y + 0.5) / pixels_per_mm));
      map.u(x, y) = static_cast<float>(scan.x());
      map.v(x, y) = static_cast<float>(scan.y());
    }
  return map;
}

const Place as_it_is = [](const Eigen::Vector2d& p) { return p; };

PageErrors compare(const Place& paper_of, double width_mm = 140, double height_mm = 180) {
  const ScanMap truth = map_of(130, 170, 5, as_it_is);
  const ScanMap result = map_of(width_mm, height_mm, 4, paper_of);
  return compare_pages({&result, 4}, {&truth, 5});
}

// The bilinear interpolation of the squeezed map, 6 exp(-x / 20) mm with pixels of 0.25 mm, errs by less than
// 0.25^2 / 8 * 6 / 400 = 1.2e-4 mm.
constexpr double interpolation_mm = 1.5e-4;

TEST(ScanMapInverse, FindsTheWayBack) {
  const ScanMap map = map_of(100, 120, 4, as_it_is);
  const ScanMapInverse inverse(map);
  for (const Eigen::Vector2d& page : {Eigen::Vector2d(3.2, 5.7), {200.1, 333.3}, {0.2, 0.1}, {398.9, 478.9}}) {
    const auto scan = scan_position(map, page);
    ASSERT_TRUE(scan);
    const auto back = inverse(*scan);
    ASSERT_TRUE(back) << page.transpose();
    EXPECT_LT((*back - page).norm(), 2e-3);
  }
  EXPECT_FALSE(inverse({0, 0})) << "outside the page";
  EXPECT_FALSE(inverse({1e30, -1e30}));
  EXPECT_FALSE(inverse({NAN, 5}));
}

TEST(ScanMapInverse, OfAMapOfNothingFindsNothing) {
  const ScanMap hidden(50, 60), empty;
  EXPECT_FALSE(ScanMapInverse(hidden)({10, 10}));
  EXPECT_FALSE(ScanMapInverse(empty)({10, 10}));
}

TEST(ScanMapInverse, OneStrayValueLosesNoMoreThanItself) {
  ScanMap map = map_of(100, 120, 4, as_it_is);
  map.u(36, 24) = 1e37f;
  const ScanMapInverse inverse(map);
  EXPECT_FALSE(inverse({1e37, 100}));
}

TEST(ComparePages, TheTruthOnAnotherPaperSizeHasNoError) {
  const PageErrors errors =
      compare([](const Eigen::Vector2d& p) -> Eigen::Vector2d { return p - Eigen::Vector2d(4, 6); });
  EXPECT_GT(errors.displacement.count, 5000u);
  EXPECT_LT(errors.displacement.max, 2 * interpolation_mm);
  EXPECT_EQ(errors.covered, 1);
  EXPECT_LT(std::abs(errors.scale_error), 1e-6);
  EXPECT_LT(errors.line_deviation_in_window, 2 * interpolation_mm);
}

TEST(ComparePages, ARotationIsAlignedAndReported) {
  const double angle = 0.02;
  const auto turned = [&](const Eigen::Vector2d& p) -> Eigen::Vector2d {
    // The paper spot at p of a result that stands askew by `angle`, clockwise: turn back, counterclockwise (y is down).
    return {std::cos(angle) * p.x() + std::sin(angle) * p.y(), -std::sin(angle) * p.x() + std::cos(angle) * p.y()};
  };
  const PageErrors errors = compare(turned, 140, 180);
  EXPECT_NEAR(errors.rotation_rad, angle, 1e-6);
  EXPECT_LT(errors.displacement.max, 2 * interpolation_mm);
  EXPECT_LT(errors.covered, 1) << "a corner is turned off the result";
  EXPECT_GT(errors.covered, 0.96);
}

TEST(ComparePages, AScaleErrorOfThreePerMille) {
  const PageErrors errors = compare([](const Eigen::Vector2d& p) -> Eigen::Vector2d { return p / 1.003; });
  EXPECT_NEAR(errors.scale_error, 0.003, 1e-6);
  EXPECT_NEAR(errors.scale_error_x, 0.003, 1e-6);
  // Displacements 0.003 r about the middle of a 130 x 170 mm page: rms 0.003 sqrt((130^2 + 170^2) / 12).
  EXPECT_NEAR(errors.displacement.rms, 0.003 * std::sqrt((130. * 130 + 170. * 170) / 12), 0.003);
  EXPECT_NEAR(errors.displacement.max, 0.003 * 0.5 * std::hypot(130, 170), 0.012);
  EXPECT_LT(errors.line_deviation.max, 2 * interpolation_mm) << "lines stay straight";
}

TEST(ComparePages, ScaleErrorsAlongAndAcrossTheLines) {
  const PageErrors errors =
      compare([](const Eigen::Vector2d& p) -> Eigen::Vector2d { return {p.x() / 1.004, p.y() / 0.998}; });
  EXPECT_NEAR(errors.scale_error_x, 0.004, 2e-5);
  EXPECT_NEAR(errors.scale_error_y, -0.002, 2e-5);
  EXPECT_NEAR(errors.scale_error, 0.001, 2e-5);
}

TEST(ComparePages, WavyLinesAreFoundWithTheirAmplitude) {
  const double amplitude = 0.2, wavelength = 26;  // five whole waves across the page
  const PageErrors errors = compare([&](const Eigen::Vector2d& p) -> Eigen::Vector2d {
    return {p.x(), p.y() - amplitude * std::sin(2 * M_PI * p.x() / wavelength)};
  });
  EXPECT_NEAR(errors.displacement.rms, amplitude / std::sqrt(2), 0.002);
  // Five waves from 0 on correlate with x a little: the best rotation is 2e-4, 0.013 mm at the outermost crests.
  EXPECT_NEAR(errors.displacement.max, amplitude, 0.014);
  // A straight line through 100 or 130 mm of this wave tilts a little with it.
  EXPECT_NEAR(errors.line_deviation.rms, amplitude / std::sqrt(2), 0.01);
  EXPECT_NEAR(errors.line_deviation_in_window, amplitude, 0.04);
}

TEST(ComparePages, ABadCornerDoesNotTurnThePage) {
  const PageErrors errors = compare([](const Eigen::Vector2d& p) -> Eigen::Vector2d {
    const double bump = std::exp(-(p - Eigen::Vector2d(120, 160)).squaredNorm() / 200);
    return p + Eigen::Vector2d(2 * bump, 0);
  });
  EXPECT_NEAR(errors.displacement.max, 2, 0.1);
  EXPECT_LT(errors.displacement.median, 0.02);
  EXPECT_LT(std::abs(errors.rotation_rad), 2e-4);
  const auto& d = errors.displacements(60, 80);  // at (121, 161) mm
  EXPECT_LT(d.x(), -1.8f) << "what belongs to the right lies to the left";
}

TEST(ComparePages, NoiseOfTheMapComesOutAsItIs) {
  ScanMap result = map_of(140, 180, 4, as_it_is);
  std::mt19937 random(1);
  std::normal_distribution<float> noise(0, 0.6f);  // 0.1 mm at 6 px a mm
  // Noise of the whole 12-px neighbourhood, as a smooth surface's error is; within it, the map stays invertible.
  Image<Eigen::Vector2f> coarse(result.width() / 24 + 2, result.height() / 24 + 2);
  for (auto& c : coarse.pixels()) c = {noise(random), noise(random)};
  for (int y = 0; y < result.height(); ++y)
    for (int x = 0; x < result.width(); ++x) {
      const float a = static_cast<float>(x % 24) / 24, b = static_cast<float>(y % 24) / 24;
      const Eigen::Vector2f n = (1 - b) * ((1 - a) * coarse(x / 24, y / 24) + a * coarse(x / 24 + 1, y / 24)) +
                                b * ((1 - a) * coarse(x / 24, y / 24 + 1) + a * coarse(x / 24 + 1, y / 24 + 1));
      result.u(x, y) += n.x();
      result.v(x, y) += n.y();
    }
  const ScanMap truth = map_of(130, 170, 5, as_it_is);
  const PageErrors errors = compare_pages({&result, 4}, {&truth, 5});
  // Bilinear interpolation leaves (2/3)^2 of the nodes' variance on average; two coordinates of 0.1 mm each. Near the
  // gutter the scan is squeezed, where the same pixels are more millimetres.
  EXPECT_NEAR(errors.displacement.rms, 0.1 * std::sqrt(2.) * 2 / 3, 0.015);
  EXPECT_EQ(errors.covered, 1);
}

TEST(ComparePages, HiddenPlacesAreNoErrorsAndLeaveACount) {
  ScanMap result = map_of(140, 180, 4, as_it_is);
  for (int y = 0; y < result.height(); ++y)
    for (int x = 0; x < 65 * 4; ++x) result.u(x, y) = result.v(x, y) = not_a_number;
  const ScanMap truth = map_of(130, 170, 5, as_it_is);
  const PageErrors errors = compare_pages({&result, 4}, {&truth, 5});
  EXPECT_NEAR(errors.covered, 0.5, 0.01);
  EXPECT_LT(errors.displacement.max, 2 * interpolation_mm);
  EXPECT_FALSE(errors.displacements(5, 5).allFinite());

  const ScanMap nowhere(100, 100);
  const PageErrors nothing = compare_pages({&nowhere, 4}, {&truth, 5});
  EXPECT_EQ(nothing.covered, 0);
  EXPECT_TRUE(std::isnan(nothing.displacement.rms));
  EXPECT_EQ(compare_pages({&truth, 5}, {&nowhere, 4}).covered, 0);
}

TEST(ComparePages, RefusesAPageWithoutScale) {
  const ScanMap map(10, 10);
  EXPECT_THROW(compare_pages({&map, 0}, {&map, 5}), std::invalid_argument);
  EXPECT_THROW(compare_pages({nullptr, 5}, {&map, 5}), std::invalid_argument);
}

}  // namespace
}  // namespace pagesweep
