// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/planning/plan_point.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <random>

#include "pagesweep/sim/analytic_scene.h"

namespace pagesweep {
namespace {

constexpr double time_sigma = 0.02;  // [frames]
constexpr int trials = 4000;         // the standard deviation of a standard deviation is 1.1 %
constexpr double tolerance = 0.045;

/// The root of a function that grows or falls, between two values where its signs differ.
double root_of(const std::function<double(double)>& function, double low, double high) {
  const bool rises = function(high) > 0;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    ((function(middle) > 0) == rises ? high : low) = middle;
  }
  return low;
}

/// A pixel that looks at level paper and measures times with noise: everything by rays and planes, no derivative.
class NoisyPixel {
 public:
  NoisyPixel(const Rig& rig, const Eigen::Vector3d& spot)
      : light_(*rig.light),
        other_(rig.cameras[1]),
        paper_{Eigen::Vector3d::UnitZ(), spot.z()},
        ray_(*rig.cameras[0].ray(*rig.cameras[0].project(spot))),
        true_distance_((spot - ray_.origin).norm()),
        true_time_(*light_.time_of(spot)) {}

  double lit(double distance) const { return *light_.time_of(ray_.at(distance)); }
  /// The time that the other camera has where it sees this place of the ray.
  double seen(double distance) const {
    return *light_.time_of(*paper_.meet(*other_.ray(*other_.project(ray_.at(distance)))));
  }
  /// Errors of the distance, as a root of what must vanish, over noisy times of both cameras.
  template <class Residual>
  double deviation(const Residual& residual) const {
    std::mt19937 random(1);
    std::normal_distribution<double> noise(0, time_sigma);
    std::uniform_real_distribution<double> place;
    double squares = 0;
    for (int n = 0; n < trials; ++n) {
      const double first = true_time_ + noise(random), x = place(random), y = place(random);
      // The other camera's time is read between four pixels, each with its own noise.
      const double second =
          (1 - y) * ((1 - x) * noise(random) + x * noise(random)) + y * ((1 - x) * noise(random) + x * noise(random));
      const auto at = [&](double distance) { return residual(distance, first, second); };
      squares += std::pow(root_of(at, true_distance_ - 5, true_distance_ + 5) - true_distance_, 2);
    }
    return std::sqrt(squares / trials);
  }

 private:
  const Light& light_;
  const Camera& other_;
  Plane paper_;
  Ray ray_;
  double true_distance_, true_time_;
};

Rig rig_with(const Light& light) {
  Rig rig = sim::make_test_rig();
  rig.light = light;
  return rig;
}

const Rig rigs[] = {
    sim::make_test_rig(), rig_with(Light(TranslatingPlane{Eigen::Vector3d(0.1, 0.9, 0.2).normalized(), -150, 1.2})),
    rig_with(Light(RotatingPlane{{0, -60, 500}, Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY(), -0.3, 0.003}))};
const Eigen::Vector3d spots[] = {{0, 0, 0}, {120, -70, 25}, {-140, 60, 50}};

TEST(PlanPoint, MonteCarloOfTheRaysAgrees) {
  for (const Rig& rig : rigs)
    for (const Eigen::Vector3d& spot : spots) {
      const SpotAccuracy plan = plan_point(rig.cameras[0], &rig.cameras[1], *rig.light, time_sigma, spot);
      const NoisyPixel pixel(rig, spot);
      const double stereo =
          pixel.deviation([&](double at, double first, double second) { return pixel.seen(at) + second - first; });
      EXPECT_NEAR(stereo / plan.stereo_mm, 1, tolerance) << spot.transpose();
      const double section = pixel.deviation([&](double at, double first, double) { return pixel.lit(at) - first; });
      EXPECT_NEAR(section / plan.section_mm, 1, tolerance) << spot.transpose();
    }
}

TEST(PlanPoint, MonteCarloOfTheJointEstimateAgrees) {
  // Weighted least squares, its minimum found where the derivative (by differences) changes its sign.
  for (const Rig& rig : rigs) {
    const Eigen::Vector3d& spot = spots[1];
    const SpotAccuracy plan = plan_point(rig.cameras[0], &rig.cameras[1], *rig.light, time_sigma, spot);
    const NoisyPixel pixel(rig, spot);
    const double joint = pixel.deviation([&](double at, double first, double second) {
      const auto cost = [&](double distance) {
        return std::pow(first - pixel.lit(distance), 2) +
               std::pow(pixel.seen(distance) + second - pixel.lit(distance), 2) / interpolated_variance;
      };
      return cost(at + 0.01) - cost(at - 0.01);
    });
    EXPECT_NEAR(joint / plan.joint_mm, 1, tolerance);
    EXPECT_LE(plan.joint_mm, plan.stereo_mm * (1 + 1e-9)) << "knowing more cannot hurt";
    EXPECT_LE(plan.joint_mm, plan.section_mm * (1 + 1e-9));
  }
}

TEST(PlanPoint, TheMatchIsUncertainByAsMuchAsThePointsPictureMoves) {
  const Rig& rig = rigs[0];
  for (const Eigen::Vector3d& spot : spots) {
    const SpotAccuracy plan = plan_point(rig.cameras[0], &rig.cameras[1], *rig.light, time_sigma, spot);
    const Eigen::Vector3d ray = (spot - rig.cameras[0].center()).normalized();
    const double moved = (*rig.cameras[1].project(spot + plan.stereo_mm * ray) - *rig.cameras[1].project(spot)).norm();
    EXPECT_NEAR(plan.match_px / moved, 1, 1e-3);
  }
}

TEST(PlanPoint, WithoutTheOtherCameraTheLightRemains) {
  const Rig& rig = rigs[0];
  const SpotAccuracy alone = plan_point(rig.cameras[0], nullptr, *rig.light, time_sigma, spots[0]);
  EXPECT_TRUE(std::isnan(alone.stereo_mm) && std::isnan(alone.match_px) && std::isnan(alone.joint_mm));
  EXPECT_GT(alone.section_mm, 0);
  const SpotAccuracy nothing = plan_point(rig.cameras[0], &rig.cameras[1], *rig.light, time_sigma, {1000, 0, 0});
  EXPECT_TRUE(std::isnan(nothing.section_mm) && std::isnan(nothing.height_share));
  EXPECT_FALSE(sees_level(rig.cameras[0], {0, 0, 700})) << "the paper is above the camera";
}

}  // namespace
}  // namespace pagesweep
