// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/calibration/fit_light.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "pagesweep/base/error.h"

namespace pagesweep {
namespace {

/// Spots on boards at some heights, seen with a scatter of the time.
std::vector<LightSighting> look(const Light& light, const std::vector<double>& heights_mm, double sigma_frames,
                                double outliers = 0) {
  std::mt19937 random(3);
  std::normal_distribution<double> scatter(0, sigma_frames);
  std::uniform_real_distribution<double> share(0, 1);
  std::vector<LightSighting> sightings;
  for (const double height : heights_mm)
    for (double x = -120; x <= 120; x += 20)
      for (double y = -100; y <= 100; y += 10) {
        const Eigen::Vector3d point(x, y, height + 0.1 * x * (height > 0));  // a board that is lifted leans
        const auto time = light.time_of(point);
        if (!time) continue;
        sightings.push_back({point, *time + scatter(random)});
        if (share(random) < outliers) sightings.back().time += 30 * share(random);
      }
  return sightings;
}

/// Largest distance from the true plane, of spots over an open book.
double worst_mm(const Light& fitted, const Light& truth) {
  double worst = 0;
  for (double x : {-120.0, 0.0, 120.0})
    for (double y : {-100.0, 0.0, 100.0})
      for (double z : {0.0, 60.0}) {
        const Eigen::Vector3d point(x, y, z);
        worst = std::max(worst, std::abs(fitted.plane_at(*truth.time_of(point)).distance(point)));
      }
  return worst;
}

const Light moving(TranslatingPlane{Eigen::Vector3d(0.02, 1, 0.15).normalized(), -150, 1.5});
const Light turning(RotatingPlane{{0, 40, 600}, Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY(), -0.3, 0.003});

TEST(FitLight, FindsAPlaneThatMoves) {
  const LightFit fit = fit_light(look(moving, {0, 40}, 0.02));
  EXPECT_FALSE(fit.turns);
  // 0.02 frames are 0.03 mm at a single spot; 546 of them tell.
  EXPECT_LT(worst_mm(fit.light, moving), 0.01);
  EXPECT_NEAR(fit.rms_mm, 0.03, 0.005);
  EXPECT_LT(fit.tilt_sigma, 0.001);
}

TEST(FitLight, FindsAPlaneThatTurns) {
  const LightFit fit = fit_light(look(turning, {0, 40}, 0.02));
  EXPECT_TRUE(fit.turns);
  EXPECT_LT(worst_mm(fit.light, turning), 0.02);
}

TEST(FitLight, OutliersHaveNoSay) {
  EXPECT_LT(worst_mm(fit_light(look(moving, {0, 40}, 0.02, 0.1)).light, moving), 0.015);
  EXPECT_LT(worst_mm(fit_light(look(turning, {0, 40}, 0.02, 0.1)).light, turning), 0.03);
}

TEST(FitLight, SaysThatAFlatBoardDoesNotShowTheTilt) {
  const LightFit fit = fit_light(look(moving, {0}, 0.02));
  EXPECT_GT(fit.tilt_sigma, 0.5);
  const Plane plane = fit.light.plane_at(100);
  EXPECT_LT(std::abs(plane.normal.z()), 0.01) << "upright is what is meant where nothing is known";
}

TEST(FitLight, WantsTheLightToCrossTheBoard) {
  auto sightings = look(moving, {0}, 0.02);
  EXPECT_THROW(fit_light(std::span(sightings).first(99)), Error);
  for (LightSighting& seen : sightings) seen.time = 50 + 0.01 * seen.time;
  EXPECT_THROW(fit_light(sightings), Error);
}

}  // namespace
}  // namespace pagesweep
