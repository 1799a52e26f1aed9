// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/outline_columns_internal.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <vector>

#include "pagesweep/base/instruction_sets_testing.h"
#include "pagesweep/timing/stripe_pixel_testing.h"

namespace pagesweep {
namespace {

TEST(OutlineColumns, AreWhatSortingTells) {
  constexpr int columns = 45, count = 57;
  std::vector<std::vector<std::uint16_t>> rows;
  std::vector<const std::uint16_t*> pointers;
  for (int i = 0; i < count; ++i) {
    auto& row = rows.emplace_back(static_cast<std::size_t>(outlined_width(columns)));
    for (int x = 0; x < columns; ++x) {
      // Few gray values, so that many are equal, up to large ones.
      const int levels = x % 3 == 0 ? 4 : x % 3 == 1 ? 300 : 65536;
      row[static_cast<std::size_t>(x)] =
          static_cast<std::uint16_t>(levels * testing::uniform(3, static_cast<std::uint64_t>(i * columns + x)));
    }
  }
  for (const auto& row : rows) pointers.push_back(row.data());
  on_every_instruction_set([&] {
    const ColumnOutlines outlines = outline_columns(pointers, columns);
    for (std::size_t x = 0; x < columns; ++x) {
      SCOPED_TRACE(x);
      std::vector<int> samples, changes;
      for (const auto& row : rows) {
        if (!samples.empty()) changes.push_back(std::abs(row[x] - samples.back()));
        samples.push_back(row[x]);
      }
      const auto highest = std::max_element(samples.begin(), samples.end());
      EXPECT_EQ(outlines.high[x], *highest);
      EXPECT_EQ(outlines.peak[x], highest - samples.begin());
      std::sort(samples.begin(), samples.end());
      std::sort(changes.begin(), changes.end());
      EXPECT_EQ(outlines.background[x], samples[background_rank(count)]);
      EXPECT_EQ(outlines.change[x], changes[(count - 1) / 2]);
    }
  });
}

}  // namespace
}  // namespace pagesweep
