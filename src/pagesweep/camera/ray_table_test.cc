// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/camera/ray_table.h"

#include <gtest/gtest.h>

#include <random>

namespace pagesweep {
namespace {

const Camera camera{"cam1", 240, 180, 320, 318, 121, 88, {-0.12, 0.05, 6e-4, -4e-4, 0.01}, {}};

TEST(RayTable, HoldsTheDirectionsOfTheCamerasRays) {
  const RayTable table(camera);
  for (int y = 0; y < camera.height; y += 7)
    for (int x = 0; x < camera.width; x += 5) {
      const auto ray = camera.ray({double(x), double(y)});
      EXPECT_LT((table.direction(x, y) - ray->direction.head<2>() / ray->direction.z()).norm(), 1e-12);
    }
}

TEST(RayTable, InterpolatesFarMoreFinelyThanAPixel) {
  const RayTable table(camera);
  std::mt19937 random(4);
  std::uniform_real_distribution<double> u(-0.5, 239.5), v(-0.5, 179.5);
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector2d pixel(u(random), v(random));
    const auto ray = camera.ray(pixel);
    const Eigen::Vector2d error = table.direction_at(pixel) - ray->direction.head<2>() / ray->direction.z();
    EXPECT_LT(error.norm() * camera.fx, 3e-4);  // a tenth of a real camera's pixels: bent ten times as much per pixel
  }
}

TEST(RayTable, HasNoDirectionWhereTheDistortionHasNoInverse) {
  Camera bent = camera;
  bent.distortion = {-1.2, 0, 0, 0, 0};  // folds back at radius 0.53
  const RayTable table(bent);
  EXPECT_TRUE(table.direction(121, 88).allFinite());
  EXPECT_FALSE(table.direction(0, 0).allFinite());
}

}  // namespace
}  // namespace pagesweep
