// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/acceptance/shapes.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include <Eigen/Cholesky>

#include <cmath>
#include <random>
#include <vector>

namespace pagesweep {
namespace {

constexpr double sigma_mm = 0.05;

/// Points of the cap within 50 degrees of +z, with noise along the radius.
std::vector<Eigen::Vector3d> noisy_cap(const Sphere& sphere, int count, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, sigma_mm);
  std::uniform_real_distribution<double> angle(-M_PI, M_PI), cosine(std::cos(50 * M_PI / 180), 1);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < count; ++i) {
    const double phi = angle(random), z = cosine(random), r = std::sqrt(1 - z * z);
    points.push_back(sphere.center +
                     (sphere.radius_mm + noise(random)) * Eigen::Vector3d(r * std::cos(phi), r * std::sin(phi), z));
  }
  return points;
}

TEST(FitPlane, FindsATiltedPlaneWithinItsNoise) {
  const Eigen::Vector3d normal = Eigen::Vector3d(0.3, -0.2, 1).normalized();
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0, sigma_mm);
  std::uniform_real_distribution<double> place(-50, 50);
  const int count = 10000;
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < count; ++i) {
    const double x = place(random), y = place(random);
    points.push_back(Eigen::Vector3d(x, y, 30 - 0.3 * x + 0.2 * y) + noise(random) * normal);
  }
  Plane plane = fit_plane(points);
  if (plane.normal.z() < 0) plane = {-plane.normal, -plane.offset};
  const double sigma_of_mean = sigma_mm / std::sqrt(count), spread_mm = 100 / std::sqrt(12);
  EXPECT_NEAR(plane.distance({0, 0, 30}), 0, 4 * sigma_of_mean);
  EXPECT_LT((plane.normal - normal).norm(), 5 * sigma_of_mean / spread_mm);
}

TEST(FitSphere, IsExactOnExactPoints) {
  const Sphere truth{{10, -20, 30}, 15};
  std::vector<Eigen::Vector3d> points;
  for (const Eigen::Vector3d& noisy : noisy_cap(truth, 100, 1))
    points.push_back(truth.center + truth.radius_mm * (noisy - truth.center).normalized());
  const Sphere sphere = fit_sphere(points, {{14, -17, 33}, 18});
  EXPECT_LT((sphere.center - truth.center).norm(), 1e-9);
  EXPECT_NEAR(sphere.radius_mm, 15, 1e-9);
}

TEST(FitSphere, ErrsAsItsCovarianceSays) {
  const Sphere truth{{1, 2, 3}, 20};
  const int runs = 400;
  double squares = 0;  // Mahalanobis distances: chi squared with 4 degrees of freedom a run
  for (unsigned seed = 1; seed <= runs; ++seed) {
    const auto points = noisy_cap(truth, 500, seed);
    const Sphere sphere = fit_sphere(points, truth);
    Eigen::Vector4d error;
    error << sphere.center - truth.center, sphere.radius_mm - truth.radius_mm;
    squares += error.dot(covariance_of(sphere, points, sigma_mm).ldlt().solve(error));
  }
  EXPECT_NEAR(squares / runs, 4, 4 * std::sqrt(8.0 / runs));
}

TEST(FitShapes, RefuseTooFewPoints) {
  const std::vector<Eigen::Vector3d> points(2, Eigen::Vector3d::Zero());
  EXPECT_THROW(fit_plane(points), std::invalid_argument);
  EXPECT_THROW(fit_sphere(points, {}), std::invalid_argument);
}

}  // namespace
}  // namespace pagesweep
