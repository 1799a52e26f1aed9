// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/sim/ray_caster.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <thread>

#include "pagesweep/base/parallel.h"

namespace pagesweep::sim {
namespace {

TEST(RayCaster, FindsTheSpotThatARayMeets) {
  const GridMesh table = make_rectangle({-50, -50, 0}, 100, 100, 5), plate = make_rectangle({-10, -10, 20}, 20, 20, 3);
  const RayCaster caster({&table, &plate});
  const SimHit near = caster.cast({{3, 4, 100}, {0, 0, -1}}), far = caster.cast({{30, 4, 100}, {0, 0, -1}});
  EXPECT_EQ(near.surface, 1);
  EXPECT_LT((plate.point(near.spot) - Eigen::Vector3d(3, 4, 20)).norm(), 1e-4);
  EXPECT_EQ(far.surface, 0);
  EXPECT_LT((table.point(far.spot) - Eigen::Vector3d(30, 4, 0)).norm(), 1e-4);
  EXPECT_EQ(caster.cast({{80, 4, 100}, {0, 0, -1}}).surface, -1);
  EXPECT_TRUE(caster.blocked({0, 0, 1}, {0, 0, 100}));
  EXPECT_FALSE(caster.blocked({30, 0, 1}, {30, 0, 100}));
}

// Embree shares TBB with everybody in the process; a device must not hold the others back.
TEST(RayCaster, LeavesAllCoresToTheProcess) {
  if (std::thread::hardware_concurrency() < 2) GTEST_SKIP() << "one core only";
  const GridMesh table = make_rectangle({-50, -50, 0}, 100, 100, 5);
  const RayCaster caster({&table});
  std::atomic<int> inside = 0, met = 0;
  parallel_rows(2, [&](int) {
    ++inside;
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    while (inside < 2 && std::chrono::steady_clock::now() < deadline) std::this_thread::yield();
    if (inside == 2) ++met;
  });
  EXPECT_EQ(met, 2);
}

}  // namespace
}  // namespace pagesweep::sim
