// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/planning/plan.h"

#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <cmath>

#include "pagesweep/base/error.h"
#include "pagesweep/sim/analytic_scene.h"

namespace pagesweep {
namespace {

PlanRequest request_for(const Rig& rig) {
  PlanRequest request;
  request.cameras = rig.cameras;
  request.light = *rig.light;
  request.table = {280, 200, 0, 0};
  request.heights_mm = {0, 40};
  request.grid_mm = 20;
  return request;
}

const Rig rig = sim::make_test_rig();

double ratio_of(const Plan& plan, std::string_view name) {
  for (const Variation& variation : plan.variations)
    if (variation.name == name) return variation.ratio;
  ADD_FAILURE() << "no variation " << name;
  return NAN;
}

TEST(MakePlan, FollowsTheScalingLaws) {
  PlanRequest request = request_for(rig);
  request.recording.read_noise_electrons = 0;  // photon noise alone, but for rounding
  request.recording.bits = 14;
  request.recording.amplitude = 0.4;
  const Plan plan = make_plan(request);
  // Height error ~ (mm/frame) sqrt(s) / (sqrt(A) S), s = stripe / (mm/frame).
  EXPECT_NEAR(ratio_of(plan, "stripe_half"), std::sqrt(0.5), 0.005);
  EXPECT_NEAR(ratio_of(plan, "stripe_double"), std::sqrt(2), 0.005);
  EXPECT_NEAR(ratio_of(plan, "speed_half"), std::sqrt(0.5), 0.005);
  EXPECT_NEAR(ratio_of(plan, "light_double"), std::sqrt(0.5), 0.005);
  EXPECT_NEAR(ratio_of(plan, "full_well_double"), std::sqrt(0.5), 0.005);
  EXPECT_NEAR(ratio_of(plan, "bits_more"), 1, 0.001);
  // The height error is that over the sine of half the angle, twice: nearly the baseline.
  EXPECT_NEAR(ratio_of(plan, "baseline_half"), 2, 0.12);
  EXPECT_GT(ratio_of(plan, "baseline_double"), 0.5);
  EXPECT_LT(ratio_of(plan, "baseline_double"), 0.65);
  EXPECT_LT(plan.best_stripe_mm, request.recording.stripe_mm);
  EXPECT_LT(plan.best_stripe_ratio, 1);
}

TEST(MakePlan, KnowsTheRig) {
  const Plan plan = make_plan(request_for(rig));
  EXPECT_NEAR(plan.mm_per_frame, 1.7, 1e-9);
  EXPECT_NEAR(plan.stripe_frames, 12 / 1.7, 1e-9);
  EXPECT_NEAR(plan.baseline_mm, 400, 1e-9);
  ASSERT_EQ(plan.heights.size(), 2u);
  EXPECT_EQ(plan.heights[0].spots.width(), 14);
  EXPECT_EQ(plan.heights[0].spots.height(), 10);
  EXPECT_EQ(plan.heights[0].share_seen_by(2), 1);
  const Spread height = spread_of(plan.heights, &SpotAccuracy::stereo_mm, true);
  const Spread ray = spread_of(plan.heights, &SpotAccuracy::stereo_mm, false);
  EXPECT_LT(height.median, ray.median);
  EXPECT_GE(height.worst, height.median);
}

TEST(MakePlan, TellsWhatOneCameraOrNoneSees) {
  PlanRequest request = request_for(rig);
  request.table = {420, 900, 0, 100};  // far beyond the cameras' pictures
  request.heights_mm = {0};
  const Plan plan = make_plan(request);
  const HeightPlan& table = plan.heights[0];
  EXPECT_NEAR(table.share_seen_by(0) + table.share_seen_by(1) + table.share_seen_by(2), 1, 1e-12);
  for (const int count : {0, 1, 2}) EXPECT_GT(table.share_seen_by(count), 0) << count;
  const Image<float> stereo = table.height_map_of(&SpotAccuracy::stereo_mm),
                     section = table.height_map_of(&SpotAccuracy::section_mm);
  for (std::size_t i = 0; i < stereo.size(); ++i) {
    EXPECT_EQ(std::isfinite(stereo.data()[i]), table.cameras.data()[i] == 2);
    EXPECT_EQ(std::isfinite(section.data()[i]), table.cameras.data()[i] > 0);
  }
}

TEST(MakePlan, OneCameraMeasuresByItsLight) {
  PlanRequest request = request_for(rig);
  request.cameras.pop_back();
  const Plan plan = make_plan(request);
  EXPECT_EQ(plan.method(), &SpotAccuracy::section_mm);
  EXPECT_TRUE(std::isnan(plan.baseline_mm));
  EXPECT_GT(spread_of(plan.heights, plan.method(), true).median, 0);
}

TEST(MakePlan, RefusesWhatCannotBeMeasured) {
  PlanRequest request = request_for(rig);
  request.table.center_x_mm = 5000;
  EXPECT_THROW(make_plan(request), Error);
  request = request_for(rig);
  request.recording.stripe_mm = 0.05;
  EXPECT_THROW(make_plan(request), Error);
  request = request_for(rig);
  request.cameras.clear();
  EXPECT_THROW(make_plan(request), std::invalid_argument);
  request = request_for(rig);
  request.grid_mm = 1e-3;
  EXPECT_THROW(make_plan(request), std::invalid_argument);
  request.grid_mm = NAN;
  EXPECT_THROW(make_plan(request), std::invalid_argument);
  request = request_for(rig);
  request.heights_mm.clear();
  EXPECT_THROW(make_plan(request), std::invalid_argument);
}

TEST(MakePlan, TakesAnotherSpeedThanTheRigs) {
  for (const Light& light :
       {*rig.light,
        Light(RotatingPlane{{0, -60, 500}, Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY(), -0.3, 0.003})}) {
    PlanRequest request = request_for(rig);
    request.light = light;
    const Plan own = make_plan(request);
    EXPECT_NEAR(own.mm_per_frame, speed_on_table(light, Eigen::Vector3d::Zero()), 1e-12);
    request.mm_per_frame = 2 * own.mm_per_frame;
    request.recording.stripe_mm *= 2;  // as many frames, and hence the same uncertainty in frames
    const Plan fast = make_plan(request);
    EXPECT_NEAR(fast.time_sigma(), own.time_sigma(), 1e-12);
    EXPECT_NEAR(spread_of(fast.heights, fast.method(), true).median / spread_of(own.heights, own.method(), true).median,
                2, 1e-6);
  }
}

TEST(MakePlan, WithoutTheRigsLightAnUprightOneIsTaken) {
  PlanRequest request = request_for(rig);
  const Plan with = make_plan(request);
  request.light = upright_light();
  request.mm_per_frame = 1.7;
  const Plan without = make_plan(request);
  EXPECT_NEAR(spread_of(without.heights, without.method(), true).worst,
              spread_of(with.heights, with.method(), true).worst, 1e-6);
}

TEST(SpreadCameras, KeepsWhatTheyLookAt) {
  const std::vector<Camera> far = spread_cameras(rig.cameras, 2);
  EXPECT_NEAR((far[1].center() - far[0].center()).norm(), 800, 1e-9);
  for (std::size_t c = 0; c < 2; ++c) {
    const auto middle = [](const Camera& camera) { return Eigen::Vector2d(camera.cx, camera.cy); };
    const Plane table{Eigen::Vector3d::UnitZ(), 0};
    const Eigen::Vector3d target = *table.meet(*rig.cameras[c].ray(middle(rig.cameras[c])));
    EXPECT_LT((*far[c].project(target) - middle(far[c])).norm(), 1e-6);
    EXPECT_NEAR((far[c].cam_from_rig.rotation * far[c].cam_from_rig.rotation.transpose()).trace(), 3, 1e-12);
  }
}

TEST(ExtentNamed, KnowsPaperSizesAndMillimetres) {
  EXPECT_EQ(extent_named("A3")->width_mm, 420);
  EXPECT_EQ(extent_named("A4")->depth_mm, 210);
  EXPECT_EQ(extent_named("300x200.5")->depth_mm, 200.5);
  EXPECT_EQ(extent_named("300x200+10-20")->center_x_mm, 10);
  EXPECT_EQ(extent_named("300x200+10-20")->center_y_mm, -20);
  for (const char* wrong :
       {"", "A9", "300", "300x", "300x200+10", "300x-2", "nanxnan", "infx3", "300x200mm", "300x200+1+2+3"})
    EXPECT_FALSE(extent_named(wrong)) << wrong;
}

}  // namespace
}  // namespace pagesweep
