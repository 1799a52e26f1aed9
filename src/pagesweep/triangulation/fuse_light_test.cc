// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/triangulation/fuse_light.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

#include "pagesweep/sim/analytic_scene.h"
#include "pagesweep/triangulation/calibrate_light.h"

namespace pagesweep {
namespace {

using sim::AnalyticScene;

constexpr float time_sigma = 0.02f;  // [frames]

const AnalyticScene book{[](double x, double) { return 30 + 25 * std::cos(x / 60); }};

/// A sheet that leans, turns a little and whose motor hesitates in a rhythm of 40 frames.
Light uneven_light() {
  RecordedPlanes planes{-60, {}};
  for (int i = planes.first_frame; i < 320; ++i) {
    const Eigen::Vector3d normal = Eigen::Vector3d(0.02 + 1e-4 * i, 1, 0.05 - 2e-4 * i);
    const double way = -170 + 1.7 * i + 0.3 * std::sin(2 * M_PI * i / 40);
    planes.planes.push_back({normal.normalized(), way / normal.norm()});
  }
  return Light(planes);
}

/// Stereo as it would be: both cameras' noisy times, matches made of the truth and of that noise, and the points.
struct Stereo {
  Rig rig = sim::make_test_rig(160);
  Light light = uneven_light();
  std::array<TimeMap, 2> times;
  std::array<Correspondences, 2> matches;
  std::array<PointMap, 2> truth, points;

  explicit Stereo(unsigned seed = 5) {
    std::mt19937 random(seed);
    std::normal_distribution<float> noise(0, time_sigma);
    for (std::size_t c = 0; c < 2; ++c) {
      const Camera &from = rig.cameras[c], &to = rig.cameras[1 - c];
      truth[c] = book.points(from);
      times[c] = book.times(from, light, time_sigma);
      matches[c] = book.correspondences(from, to);
      points[c] = PointMap(from.width, from.height);
      for (int y = 0; y < from.height; ++y)
        for (int x = 0; x < from.width; ++x) {
          const float own = noise(random), other = noise(random);
          times[c].time(x, y) += own;
          put(c, x, y, own, other);
        }
    }
  }

 private:
  /// The point moves along its ray by (own - other) / (d time_2 / d distance), the surface being locally flat.
  void put(std::size_t c, int x, int y, float own, float other) {
    const Camera &from = rig.cameras[c], &to = rig.cameras[1 - c];
    points[c].status(x, y) = matches[c].status(x, y);
    if (matches[c].status(x, y) != PixelStatus::ok) return;
    const Eigen::Vector3d point(truth[c].x(x, y), truth[c].y(x, y), truth[c].z(x, y));
    const Eigen::Vector3d ray = (point - from.center()).normalized();
    // Where the other camera's pixel of a point a little farther along the ray hits the surface.
    constexpr double step = 0.5;
    const auto time_seen = [&](double distance) {
      const Eigen::Vector3d place = point + distance * ray;
      const auto hit = book.meet({to.center(), (place - to.center()).normalized()});
      return hit ? *light.time_of(*hit) : std::nan("");
    };
    const double frames_per_mm = (time_seen(step) - time_seen(-step)) / (2 * step);
    if (!std::isfinite(frames_per_mm)) {
      points[c].status(x, y) = PixelStatus::no_match;
      return;
    }
    const double pixels_per_mm = (to.project_jacobian(point) * ray).norm();
    matches[c].slope(x, y) = static_cast<float>(-frames_per_mm / pixels_per_mm);
    const Eigen::Vector3f moved = (point + (own - other) / frames_per_mm * ray).cast<float>();
    points[c].x(x, y) = moved.x();
    points[c].y(x, y) = moved.y();
    points[c].z(x, y) = moved.z();
    points[c].sigma(x, y) = static_cast<float>(std::sqrt(2.0) * time_sigma / std::abs(frames_per_mm));
    matches[c].sigma(x, y) = static_cast<float>(points[c].sigma(x, y) * pixels_per_mm);
  }
};

struct Errors {
  double rms = 0, normalised = 0;
  int count = 0;
};

Errors compare(const PointMap& points, const PointMap& truth) {
  Errors errors;
  for (std::size_t i = 0; i < points.x.size(); ++i) {
    if (points.status.data()[i] != PixelStatus::ok || truth.status.data()[i] != PixelStatus::ok) continue;
    const Eigen::Vector3d error(points.x.data()[i] - truth.x.data()[i], points.y.data()[i] - truth.y.data()[i],
                                points.z.data()[i] - truth.z.data()[i]);
    errors.rms += error.squaredNorm();
    errors.normalised += error.squaredNorm() / std::pow(points.sigma.data()[i], 2);
    ++errors.count;
  }
  errors.rms = std::sqrt(errors.rms / errors.count);
  errors.normalised = std::sqrt(errors.normalised / errors.count);
  return errors;
}

TEST(CalibrateLight, FindsTheSheetOfAnUnevenMotorToAFewMicrometres) {
  const Stereo stereo;
  const auto sweep = calibrate_light(stereo.points, stereo.times);
  ASSERT_TRUE(sweep);
  EXPECT_NEAR(sweep->mm_per_frame, 1.7, 0.02);
  EXPECT_NEAR(sweep->unevenness_rms_mm, 0.3 / std::sqrt(2), 0.05);
  double squares = 0;
  int count = 0;
  for (std::size_t i = 0; i < stereo.truth[0].x.size(); i += 7) {
    if (stereo.points[0].status.data()[i] != PixelStatus::ok) continue;
    const Eigen::Vector3d point(stereo.truth[0].x.data()[i], stereo.truth[0].y.data()[i], stereo.truth[0].z.data()[i]);
    squares += std::pow(*sweep->light.time_of(point) - *stereo.light.time_of(point), 2);
    ++count;
  }
  EXPECT_LT(1.7 * std::sqrt(squares / count), 0.01);  // [mm]; single points have 0.1
}

TEST(CalibrateLight, SaysSoWhereThereIsTooLittle) {
  const std::array<PointMap, 1> points{PointMap(20, 20)};
  const std::array<TimeMap, 1> times{TimeMap(20, 20)};
  EXPECT_FALSE(calibrate_light(points, times));
  EXPECT_THROW(calibrate_light(points, {}), std::invalid_argument);
}

TEST(FuseLight, PointsGetBetterAndKnowByHowMuch) {
  Stereo stereo;
  const Errors before = compare(stereo.points[0], stereo.truth[0]);
  const FusionCounts counts =
      fuse_light(stereo.points[0], stereo.matches[0], stereo.times[0], stereo.rig.cameras[0], stereo.light);
  const Errors after = compare(stereo.points[0], stereo.truth[0]);
  EXPECT_GT(counts.weighted, 10000);
  EXPECT_NEAR(before.normalised, 1, 0.05);
  EXPECT_NEAR(after.normalised, 1, 0.05);
  EXPECT_LE(after.rms, 1.001 * before.rms);
}

TEST(FuseLight, WhatOneCameraSeesIsMeasured) {
  Stereo stereo;
  for (int y = 60; y < 100; ++y)
    for (int x = 60; x < 80; ++x) stereo.points[0].status(x, y) = PixelStatus::no_match;
  const FusionCounts counts =
      fuse_light(stereo.points[0], stereo.matches[0], stereo.times[0], stereo.rig.cameras[0], stereo.light);
  EXPECT_GE(counts.added, 700);
  for (int y = 60; y < 100; ++y)
    for (int x = 60; x < 80; ++x) {
      if (stereo.points[0].status(x, y) != PixelStatus::ok) continue;
      EXPECT_NEAR(stereo.points[0].z(x, y), stereo.truth[0].z(x, y), 6 * stereo.points[0].sigma(x, y));
    }
}

TEST(FuseLight, AWrongMatchIsOverruledAndLightThatDelaysBothCamerasIsNot) {
  Stereo stereo;
  const int x = 70, y = 80;
  stereo.points[0].z(x, y) += 3;
  // A facing page delays the times of a whole region: both cameras' alike, so that the points do not move.
  for (int row = 20; row < 60; ++row)
    for (int column = 20; column < 120; ++column) stereo.times[0].time(column, row) += 0.3f;
  fuse_light(stereo.points[0], stereo.matches[0], stereo.times[0], stereo.rig.cameras[0], stereo.light);
  EXPECT_NEAR(stereo.points[0].z(x, y), stereo.truth[0].z(x, y), 6 * stereo.points[0].sigma(x, y));
  for (int row = 32; row < 48; ++row)
    for (int column = 32; column < 108; ++column) {
      if (stereo.points[0].status(column, row) != PixelStatus::ok) continue;
      EXPECT_NEAR(stereo.points[0].z(column, row), stereo.truth[0].z(column, row),
                  6 * stereo.points[0].sigma(column, row));
    }
}

TEST(FuseLight, RefusesOtherSizes) {
  const Rig rig = sim::make_test_rig(64);
  PointMap points(64, 64);
  EXPECT_THROW(fuse_light(points, Correspondences(64, 64), TimeMap(63, 64), rig.cameras[0], *rig.light),
               std::invalid_argument);
}

}  // namespace
}  // namespace pagesweep
