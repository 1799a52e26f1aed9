// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/sample_scans_internal.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "pagesweep/base/instruction_sets_testing.h"
#include "pagesweep/timing/stripe_pixel_testing.h"

namespace pagesweep {
namespace {

TEST(SampleScans, AreWhatALoopTells) {
  constexpr float infinity = std::numeric_limits<float>::infinity();
  std::vector<float> gray, present, slope;
  for (std::uint64_t k = 0; k < 80; ++k) {
    gray.push_back(k % 7 == 3 ? infinity : static_cast<float>(100 * testing::uniform(1, k)));
    present.push_back(k % 5 == 1 ? 0.0F : 1.0F);
    slope.push_back(static_cast<float>(testing::uniform(2, k) - 0.5));
  }
  on_every_instruction_set([&] {
    for (int count = 1; count <= 64; ++count) {
      SCOPED_TRACE(count);
      SampleScan expected{infinity, 0, 0, 0};
      LostSlopes lost{};
      for (std::size_t k = 0; k < static_cast<std::size_t>(count); ++k) {
        const int side = slope[k] > 0 ? 0 : 1;
        if (present[k] == 0) {
          lost.absent[side] += slope[k] * slope[k];
        } else if (std::isinf(gray[k])) {
          ++expected.clipped;
          lost.clipped[side] += slope[k] * slope[k];
        } else {
          ++expected.seen;
          expected.low = std::min(expected.low, gray[k]);
          expected.high = std::max(expected.high, gray[k]);
        }
      }
      const SampleScan scan = scan_samples(gray.data(), present.data(), count);
      EXPECT_EQ(scan.low, expected.low);
      EXPECT_EQ(scan.high, expected.high);
      EXPECT_EQ(scan.seen, expected.seen);
      EXPECT_EQ(scan.clipped, expected.clipped);
      const LostSlopes sums = lost_slopes(slope.data(), gray.data(), present.data(), count);
      for (int side = 0; side < 2; ++side) {
        EXPECT_NEAR(sums.absent[side], lost.absent[side], 1e-5F);
        EXPECT_NEAR(sums.clipped[side], lost.clipped[side], 1e-5F);
      }
    }
  });
}

}  // namespace
}  // namespace pagesweep
