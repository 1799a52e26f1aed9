// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/base/parallel.h"

#include <gtest/gtest.h>

#include <atomic>
#include <mutex>
#include <set>
#include <stdexcept>
#include <utility>
#include <vector>

namespace pagesweep {
namespace {

TEST(Parallel, CoversEveryRowOnce) {
  std::vector<std::atomic<int>> visits(1001);
  parallel_rows(1001, [&](int y) { ++visits[static_cast<std::size_t>(y)]; });
  for (const auto& count : visits) EXPECT_EQ(count, 1);
}

TEST(Parallel, RangesDoNotDependOnTheNumberOfThreads) {
  const auto ranges = [](int threads) {
    const ThreadLimit limit(threads);
    std::mutex mutex;
    std::set<std::pair<int, int>> seen;
    parallel_ranges(103, 10, [&](int begin, int end) {
      const std::lock_guard lock(mutex);
      seen.emplace(begin, end);
    });
    return seen;
  };
  EXPECT_EQ(ranges(1), ranges(4));
  EXPECT_EQ(ranges(1).size(), 11u);
  EXPECT_TRUE(ranges(1).contains({100, 103}));
}

TEST(Parallel, AnExceptionReachesTheCaller) {
  EXPECT_THROW(parallel_rows(100,
                             [](int y) {
                               if (y == 50) throw std::runtime_error("row 50");
                             }),
               std::runtime_error);
  EXPECT_THROW(parallel_ranges(10, 0, [](int, int) {}), std::invalid_argument);
}

TEST(Parallel, NoRowsAreNoWork) {
  parallel_rows(0, [](int) { FAIL(); });
  parallel_rows(-3, [](int) { FAIL(); });
}

}  // namespace
}  // namespace pagesweep
