// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/curve_crossings_internal.h"

#include <gtest/gtest.h>

#include <hwy/targets.h>
#include <Eigen/Geometry>
#include <cmath>

#include "pagesweep/matching/epipolar_curve.h"
#include "pagesweep/sim/analytic_scene.h"

namespace pagesweep {
namespace {

/// The curves of some pixels of one camera in another, once along its rows.
TEST(CurveCrossings, LieOnTheTangentsOfTheTrueCurves) {
  Rig rig = sim::make_test_rig(200);
  for (const bool is_turned : {false, true}) {
    if (is_turned) {
      const Rigid3 quarter(Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitZ()).toRotationMatrix(),
                           Eigen::Vector3d::Zero());
      rig.cameras[1].cam_from_rig = quarter * rig.cameras[1].cam_from_rig;
    }
    const RayTable from(rig.cameras[0]), to(rig.cameras[1]);
    const EpipolarGeometry geometry(from, to, {1 / 800.0, 1 / 400.0});
    const View& view = geometry.view();
    const Eigen::Vector3d& b = geometry.origin();
    const CurveFrame frame{view.lens(), {b.x(), b.y(), b.z()}, {}, {}, 0, 0};
    for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
      SCOPED_TRACE(hwy::TargetName(target));
      hwy::SetSupportedTargetsForTest(target);
      CrossingBatch batch;
      for (std::size_t k = 0; k < CrossingBatch::most; ++k) {
        const Eigen::Vector3d a = geometry.direction(20 + 10 * static_cast<int>(k), 60 + 3 * static_cast<int>(k));
        for (int i = 0; i < 3; ++i) batch.direction[static_cast<std::size_t>(i)][k] = a[i];
        batch.inverse_depth[k] = 1 / 640.0;
      }
      batch.inverse_depth[5] = 1 / 40.0;  // not in the picture
      cross_grid(frame, to.width(), to.height(), batch);
      spread_crossings(to.width(), to.height(), batch);
      EXPECT_EQ(batch.known[5], 0);
      for (std::size_t k = 0; k < CrossingBatch::most; ++k) {
        if (k == 5) continue;
        ASSERT_EQ(batch.known[k], 1);
        EXPECT_EQ(batch.along_rows[k] > 0, is_turned);
        const EpipolarCurve curve = geometry.curve(20 + 10 * static_cast<int>(k), 60 + 3 * static_cast<int>(k));
        for (std::size_t i = 0; i < CrossingBatch::crossings; ++i) {
          const auto ahead = static_cast<double>(i);
          const auto there = curve.at(batch.depth_at_first[k] + ahead * batch.step[k]);
          ASSERT_TRUE(there);
          const double along = batch.first[k] + ahead, across = batch.at_first[k] + ahead * batch.slope[k];
          EXPECT_NEAR((*there)[is_turned ? 0 : 1], along, 0.01);  // what the lens and perspective bend
          EXPECT_NEAR((*there)[is_turned ? 1 : 0], across, 0.001);
          const double share = (batch.share[4 * k + i] & 0x7fff) / 32768.0;
          EXPECT_EQ(batch.share[4 * k + i] >> 16, batch.share[4 * k + i] & 0x7fff);
          EXPECT_NEAR(batch.low[4 * k + i] + share, across, 1e-4);
          EXPECT_NEAR(batch.noise_share[i][k], share * share + (1 - share) * (1 - share), 1e-4);
        }
      }
    }
    hwy::SetSupportedTargetsForTest(0);
  }
}

}  // namespace
}  // namespace pagesweep
