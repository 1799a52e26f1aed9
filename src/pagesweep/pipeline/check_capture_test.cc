// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "pagesweep/drift/check_rig.h"
#include "pagesweep/matching/match_epipolar.h"
#include "pagesweep/sim/analytic_scene.h"
#include "pagesweep/triangulation/triangulate.h"

namespace pagesweep {
namespace {

/// Something like print on the paper, 0.2 to 1; waves of 12 mm and more, eight pixels of the small cameras.
double albedo(const Eigen::Vector3d& point) {
  const double x = point.x(), y = point.y();
  return 0.6 + 0.13 * std::sin(0.43 * x + 0.21 * y) + 0.13 * std::sin(0.33 * y - 0.37 * x + 1) +
         0.14 * std::sin(0.17 * x - 0.47 * y + 2);
}

/// The test rig, its scanner of a sixteenth of the resolution: about that of the small cameras.
Rig make_rig() {
  Rig rig = sim::make_test_rig(256);
  auto scanner = std::get<Pushbroom>(rig.scanner->model());
  scanner.width /= 16;
  scanner.height /= 16;
  scanner.f /= 16;
  scanner.cx = (scanner.cx + 0.5) / 16 - 0.5;
  scanner.step *= 16;
  rig.scanner = Scanner(scanner);
  return rig;
}

/// A curved page under a rig, seen without noise.
class CheckCapture : public ::testing::Test {
 protected:
  const Rig truth = make_rig();
  const sim::AnalyticScene scene{[](double x, double y) { return 25 + 12 * std::sin(0.02 * x) + 0.03 * y; }};
  std::vector<TimeMap> times;
  Picture scan;

  CheckCapture() {
    for (const Camera& camera : truth.cameras) {
      times.push_back(scene.times(camera, *truth.light));
      const PointMap points = scene.points(camera);
      for (int y = 0; y < points.height(); ++y)
        for (int x = 0; x < points.width(); ++x)
          times.back().amplitude(x, y) =
              static_cast<float>(180 * albedo({points.x(x, y), points.y(x, y), points.z(x, y)}));
    }
    scan = make_picture(truth.scanner->width(), truth.scanner->height(), 1, 8);
    auto& samples = std::get<Image<std::uint8_t>>(scan.samples);
    for (int v = 0; v < scan.height(); ++v)
      for (int u = 0; u < scan.width(); ++u) {
        const auto ray = truth.scanner->ray({u, v});
        const auto point = ray ? scene.meet(*ray) : std::nullopt;
        if (point)
          samples(u, v) = static_cast<std::uint8_t>(255 * (1.055 * std::pow(albedo(*point), 1 / 2.4) - 0.055) + 0.5);
      }
  }

  std::vector<PointMap> measure(const std::vector<Camera>& cameras) const {
    const MatchPair matches = match_times(times[0], times[1], cameras[0], cameras[1]);
    return {triangulate(matches.from_first, times[0].amplitude, cameras[0], cameras[1]),
            triangulate(matches.from_second, times[1].amplitude, cameras[1], cameras[0])};
  }

  RigCheck check(const Rig& rig) const {
    const auto points = measure(rig.cameras);
    return check_rig({rig, rig.cameras[0], rig.cameras[1], times[0], times[1], points[0], &scan});
  }

  /// rms distance of the points from where they are [mm]
  double error_mm(const std::vector<Camera>& cameras) const {
    const PointMap measured = measure(cameras)[0], exact = scene.points(truth.cameras[0]);
    double squares = 0, count = 0;
    for (std::size_t i = 0; i < measured.x.size(); ++i) {
      if (measured.status.data()[i] != PixelStatus::ok || exact.status.data()[i] != PixelStatus::ok) continue;
      squares += std::pow(measured.x.data()[i] - exact.x.data()[i], 2) +
                 std::pow(measured.y.data()[i] - exact.y.data()[i], 2) +
                 std::pow(measured.z.data()[i] - exact.z.data()[i], 2);
      count += 1;
    }
    return std::sqrt(squares / count);
  }
};

TEST_F(CheckCapture, ATrueRigHolds) {
  const RigCheck seen = check(truth);
  EXPECT_GE(seen.ties.size(), 40U);
  EXPECT_LT(seen.across_px.median, 0.02);
  ASSERT_TRUE(seen.scan_mm && seen.light_mm);
  // A pixel of these cameras is 1.6 mm.
  EXPECT_LT(seen.scan_mm->median, 0.05);
  EXPECT_LT(seen.light_mm->median, 0.015);
  EXPECT_LT(seen.correction.moved_rms_mm, 0.02);
}

TEST_F(CheckCapture, ACameraThatHasMovedIsFoundAndPutRight) {
  Rig rig = truth;
  Camera& camera = rig.cameras[1];
  const Eigen::Vector3d center = camera.center() + Eigen::Vector3d(0.1, 0.2, -0.2);
  const Eigen::Vector3d axis(0.48, -0.6, 0.64);
  camera.cam_from_rig.rotation = Eigen::AngleAxisd(0.05 * M_PI / 180, axis) * camera.cam_from_rig.rotation;
  camera.cam_from_rig.translation = -(camera.cam_from_rig.rotation * center);
  const RigCheck seen = check(rig);
  EXPECT_GT(error_mm(rig.cameras), 0.1);
  EXPECT_GT(seen.correction.moved_rms_mm, 0.1);
  // Pixels are four times as wide as those with which 0.03 mm are promised.
  EXPECT_LT(error_mm({seen.correction.cameras[0].camera, seen.correction.cameras[1].camera}), 0.06);
}

}  // namespace
}  // namespace pagesweep
