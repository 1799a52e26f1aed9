// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/acceptance/measure_artefact.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pagesweep/acceptance/artefact_scene_testing.h"
#include "pagesweep/acceptance/find_spheres.h"
#include "pagesweep/base/error.h"

namespace pagesweep {
namespace {

using test::ArtefactScene;

/// Range of n values of unit normal noise without the 0.3 % farthest from 0: between the quantiles 0.0015 and 0.9985.
constexpr double range_of_noise = 2 * 2.968;

TEST(MeasureArtefact, FindsNoiseAndNothingElse) {
  const ArtefactScene scene;
  const PoseResult result = measure_artefact(scene.measure(), scene.artefact());
  ASSERT_TRUE(result.plate) << result.plate_reason;
  ASSERT_EQ(result.spheres.size(), 2u) << result.spheres_reason;
  const Deviations& plate = result.plate->deviations;
  EXPECT_EQ(plate.discarded, static_cast<std::size_t>(0.003 * double(plate.points)));
  EXPECT_EQ(plate.far_points, 0u);
  // The rms of n points is uncertain by 1 / sqrt(2 n).
  EXPECT_NEAR(plate.rms_over_claim(), 1, 4 / std::sqrt(2.0 * double(plate.points)));
  // Perpendicular, noise along the rays is smaller by their slope, which varies over the plate by a few per cent.
  EXPECT_NEAR(plate.range_mm, range_of_noise * plate.claimed_rms_mm, 0.1 * plate.range_mm);
  EXPECT_GT(plate.full_range_mm, plate.range_mm);
  for (const SphereResult& sphere : result.spheres) {
    const Deviations& deviations = sphere.deviations;
    EXPECT_NEAR(deviations.rms_over_claim(), 1, 4 / std::sqrt(2.0 * double(deviations.points)));
    EXPECT_NEAR(deviations.range_mm, range_of_noise * deviations.claimed_rms_mm, 0.25 * deviations.range_mm);
  }
}

TEST(MeasureArtefact, ErrsInSpacingByWhatItSays) {
  const ArtefactScene scene;
  double squares = 0;
  const int runs = 6;
  for (unsigned seed = 1; seed <= runs; ++seed) {
    const auto spacing = measure_artefact(scene.measure(seed), scene.artefact()).spacing;
    ASSERT_TRUE(spacing);
    EXPECT_EQ(spacing->calibrated_mm, 150);
    squares += std::pow(spacing->error_mm() / spacing->noise_mm, 2);
  }
  EXPECT_LT(squares / runs, 1 + 4 * std::sqrt(2.0 / runs));  // chi squared
  EXPECT_GT(squares / runs, 0.05);
}

TEST(MeasureArtefact, IsExactWithoutNoise) {
  ArtefactScene scene;
  scene.sigma_mm = 1e-9;
  const PoseResult result = measure_artefact(scene.measure(), scene.artefact());
  ASSERT_TRUE(result.plate && result.spacing);
  constexpr double float_mm = 2e-4;  // points are floats in a frame of some hundred millimetres
  EXPECT_LT(result.plate->deviations.range_mm, float_mm);
  EXPECT_LT((result.plate->plate.middle - scene.plate_middle).norm(), 2);  // of points 2 mm apart
  for (const SphereResult& sphere : result.spheres) {
    EXPECT_LT(sphere.deviations.range_mm, float_mm);
    EXPECT_NEAR(sphere.size_error_mm(), 0, float_mm);
  }
  EXPECT_NEAR(result.spacing->error_mm(), 0, float_mm);
  EXPECT_LT(result.spheres[0].sphere.center.x(), result.spheres[1].sphere.center.x());
}

TEST(MeasureArtefact, ReportsASizeThatIsNotTheCalibratedOne) {
  ArtefactScene scene;
  scene.sigma_mm = 1e-9;
  Artefact artefact = scene.artefact();
  artefact.sphere_diameters_mm = {40.1, 39.9};
  artefact.spacing_mm = 149.5;
  const PoseResult result = measure_artefact(scene.measure(), artefact);
  ASSERT_TRUE(result.spacing);
  EXPECT_NEAR(result.spheres[0].size_error_mm(), -0.1, 1e-3);
  EXPECT_NEAR(result.spheres[1].size_error_mm(), 0.1, 1e-3);
  EXPECT_NEAR(result.spacing->error_mm(), 0.5, 1e-3);
}

TEST(MeasureArtefact, FindsThePlateInEveryPose) {
  for (const Eigen::Vector2d& slope : {Eigen::Vector2d(0, 0), Eigen::Vector2d(0.3, 0), Eigen::Vector2d(-0.1, 0.25)})
    for (const double turn : {0.0, 0.7, 1.5}) {
      ArtefactScene scene;
      scene.centers.clear();
      scene.plate_slope = slope;
      scene.plate_turn_rad = turn;
      const PoseResult result = measure_artefact(scene.measure(), scene.artefact());
      ASSERT_TRUE(result.plate) << slope.transpose() << " turned by " << turn << ": " << result.plate_reason;
      const Eigen::Vector3d normal = Eigen::Vector3d(-slope.x(), -slope.y(), 1).normalized();
      EXPECT_LT((result.plate->plate.plane.normal - normal).norm(), 1e-3);
    }
}

TEST(MeasureArtefact, DoesNotOverlookABadPoint) {
  const ArtefactScene scene;
  ArtefactPose pose = scene.measure();
  const auto before = measure_artefact(pose, scene.artefact());
  // The pixels of the first camera that see the plate's middle: off by 2 mm along the ray, ten of them.
  const Eigen::Vector2d at = *pose.cameras[0].project(scene.plate_middle);
  for (int k = 0; k < 10; ++k) {
    const int x = static_cast<int>(at.x()) + k, y = static_cast<int>(at.y());
    pose.points[0].z(x, y) += 2;
  }
  const auto after = measure_artefact(pose, scene.artefact());
  ASSERT_TRUE(before.plate && after.plate);
  EXPECT_GT(after.plate->deviations.full_range_mm, 1.5);
  EXPECT_GT(after.plate->deviations.rms_mm, 1.1 * before.plate->deviations.rms_mm);
  EXPECT_EQ(after.plate->deviations.points, before.plate->deviations.points);
  // Fewer than 0.3 %: the guideline permits to discard them, instead of ten others.
  EXPECT_LT(after.plate->deviations.range_mm, 1.02 * before.plate->deviations.full_range_mm);
}

TEST(MeasureArtefact, TellsWhatItDoesNotFind) {
  ArtefactScene scene;
  scene.centers.pop_back();
  Artefact artefact = ArtefactScene().artefact();
  const PoseResult one_sphere = measure_artefact(scene.measure(), artefact);
  EXPECT_TRUE(one_sphere.plate);
  EXPECT_TRUE(one_sphere.spheres.empty());
  EXPECT_FALSE(one_sphere.spacing);
  EXPECT_THAT(one_sphere.spheres_reason, testing::HasSubstr("not two spheres"));
  artefact.plate_mm = Eigen::Vector2d(200, 80);
  try {
    measure_artefact(scene.measure(), artefact);
    FAIL() << "something was found";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::no_result);
    EXPECT_THAT(error.what(), testing::HasSubstr("no flat rectangle of 200 mm x 80 mm"));
  }
}

TEST(MeasureArtefact, FindsNothingInAnEmptyMap) {
  ArtefactPose pose = ArtefactScene().measure();
  for (PointMap& map : pose.points) map = PointMap(map.width(), map.height());
  EXPECT_THROW(measure_artefact(pose, ArtefactScene().artefact()), Error);
}

TEST(MeasureArtefact, RefusesToDiscardMoreThanTheGuideline) {
  const ArtefactScene scene;
  AcceptanceOptions options;
  options.discarded_share = 0.01;
  EXPECT_THROW(measure_artefact({}, scene.artefact(), options), std::invalid_argument);
}

}  // namespace
}  // namespace pagesweep
