// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/surfacing/ruled_surface.h"

#include <gtest/gtest.h>

#include <functional>

#include "pagesweep/base/error.h"
#include "pagesweep/surfacing/scenes_for_tests.h"

namespace pagesweep {
namespace {

/// Places 2 mm apart over 160 x 200 mm, with noise.
std::vector<Support> places(const std::function<double(double p, double q)>& height, double noise_mm) {
  const scenes::Noise noise(3);
  std::vector<Support> cells;
  for (double p = -80; p <= 80; p += 2)
    for (double q = -100; q <= 100; q += 2)
      cells.push_back({{p, q},
                       height(p, q) + noise_mm * noise.gauss(cells.size()),
                       1 / (noise_mm * noise_mm),
                       Eigen::Matrix2d::Zero()});
  return cells;
}

double rms_error(const RuledSurface& surface, const std::function<double(double p, double q)>& height) {
  double squares = 0;
  int n = 0;
  for (double p = -78; p <= 78; p += 3.7)
    for (double q = -95; q <= 95; q += 4.1, ++n) squares += std::pow(surface.height({p, q}) - height(p, q), 2);
  return std::sqrt(squares / n);
}

TEST(RuledSurface, FindsTheDirectionOfTheRulings) {
  const double turn = 0.07;
  const auto wave = [&](double p, double q) { return 8 * std::sin((p * std::cos(turn) + q * std::sin(turn)) / 20); };
  const RuledSurface surface = fit_ruled_surface(places(wave, 0.05));
  // 8000 places of 0.05 mm, of which the best fit costs some 60 unknowns: 0.05 sqrt(60 / 8000) = 0.004
  EXPECT_LT(rms_error(surface, wave), 0.01);
  // The change of the profile takes up a wrong angle d but for d^2 b^2 z'' / 2, which for 0.015 rad is 0.02 mm at the
  // ends.
  EXPECT_NEAR(surface.frame.angle_rad(), turn, 0.015);
  EXPECT_NEAR(surface.frame.fan, 0, 2e-4);
}

TEST(RuledSurface, FindsTheApexOfACone) {
  const double apex_q = -500;
  const auto cone = [&](double p, double q) {
    return 0.05 * std::hypot(p, q - apex_q) * std::cos(12 * std::atan2(p, q - apex_q));
  };
  const RuledSurface surface = fit_ruled_surface(places(cone, 0.05));
  EXPECT_LT(rms_error(surface, cone), 0.01);
  // Likewise a wrong fan is mostly taken up: it is known to a fifth or so.
  EXPECT_NEAR(1 / surface.frame.fan, -apex_q, 150);
}

TEST(RuledSurface, AllowsRulingsAcrossThePage) {
  const auto roll = [](double, double q) { return 10 * std::cos(q / 25); };
  const RuledSurface surface = fit_ruled_surface(places(roll, 0.05));
  EXPECT_LT(rms_error(surface, roll), 0.01);
}

TEST(RuledSurface, IsNotPulledByADent) {
  const auto sheet = [](double p, double) { return 0.002 * p * p; };
  const auto dented = [&](double p, double q) {
    return sheet(p, q) + 4 * std::exp(-(std::pow(p - 20, 2) + std::pow(q + 30, 2)) / 200);
  };
  // The dent covers a twentieth of some rulings; plain least squares would follow it by 0.2 mm.
  EXPECT_LT(rms_error(fit_ruled_surface(places(dented, 0.05)), sheet), 0.03);
}

TEST(RuledSurface, SlopesAgreeWithDifferences) {
  const auto wave = [](double p, double q) { return (6 + 0.02 * q) * std::sin(p / 20); };
  const RuledSurface surface = fit_ruled_surface(places(wave, 0.05));
  const double h = 1e-4;
  for (double alpha = -70; alpha < 70; alpha += 9.3) {
    const auto here = surface.at(alpha, 12);
    EXPECT_NEAR(here.slope, (surface.at(alpha + h, 12).z - surface.at(alpha - h, 12).z) / (2 * h), 1e-7);
    EXPECT_NEAR(here.curvature, (surface.at(alpha + h, 12).slope - surface.at(alpha - h, 12).slope) / (2 * h), 1e-6);
  }
}

TEST(RuledSurface, NeedsSixPlaces) {
  const auto cells = places([](double, double) { return 0.0; }, 0.05);
  EXPECT_THROW(fit_ruled_surface(std::span(cells).first(5)), Error);
}

TEST(RuledSurface, NormalsStandOnItsPoints) {
  RuledSurface surface;
  surface.frame = {{3, -4}, 0.2, 1e-3};
  surface.b_low = -100;
  surface.b_high = 120;
  surface.splines = CubicBSplines({0, 20, 50, 100});
  surface.low = Eigen::VectorXd::LinSpaced(6, 0, 40).array().sin() * 5;
  surface.high = Eigen::VectorXd::LinSpaced(6, 0, 30).array().cos() * 8;
  constexpr double h = 1e-4;
  for (const double alpha : {5.0, 33.0, 90.0})
    for (const double b : {-80.0, 10.0, 110.0}) {
      const Eigen::Vector3d normal = surface.normal(alpha, b);
      EXPECT_NEAR(normal.norm(), 1, 1e-12);
      EXPECT_GT(normal.z(), 0);
      EXPECT_NEAR(normal.dot(surface.point(alpha + h, b) - surface.point(alpha - h, b)) / (2 * h), 0, 1e-6);
      EXPECT_NEAR(normal.dot(surface.point(alpha, b + h) - surface.point(alpha, b - h)) / (2 * h), 0, 1e-6);
    }
}

TEST(RulingFrame, GoesThereAndBack) {
  const RulingFrame frame{{3, -4}, 0.2, 1e-3};
  const Eigen::Vector2d plan(40, 70);
  const Eigen::Vector2d ruling = frame.ruling_from_plan(plan);
  EXPECT_LT((frame.plan_from_ruling(ruling.x(), ruling.y()) - plan).norm(), 1e-12);
}

}  // namespace
}  // namespace pagesweep
