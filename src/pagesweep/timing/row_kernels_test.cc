// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "pagesweep/base/instruction_sets_testing.h"
#include "pagesweep/timing/row_kernels_internal.h"
#include "pagesweep/timing/stripe_pixel_testing.h"

namespace pagesweep {
namespace {

template <class T>
class RowKernels : public ::testing::Test {
 protected:
  static constexpr int width = 71, frames = 45, left = 3;
  std::vector<std::vector<T>> values;
  std::vector<const T*> rows;

  RowKernels() {
    for (int i = 0; i < frames; ++i) {
      values.emplace_back();
      for (int x = 0; x < width; ++x) {
        const double share = testing::uniform(5, static_cast<std::uint64_t>(i * width + x));
        values.back().push_back(static_cast<T>(share * std::numeric_limits<T>::max()));
      }
    }
    for (const auto& row : values) rows.push_back(row.data());
  }
};

using Depths = ::testing::Types<std::uint8_t, std::uint16_t>;
TYPED_TEST_SUITE(RowKernels, Depths);

TYPED_TEST(RowKernels, SumsAreExact) {
  on_every_instruction_set([&] {
    std::vector<float> sums(this->width - this->left);
    sum_rows(std::span<const TypeParam* const>(this->rows), this->left, 0.5F, sums);
    for (int x = 0; x < this->width - this->left; ++x) {
      std::int64_t sum = 0;
      for (const auto& row : this->values) sum += row[static_cast<std::size_t>(x + this->left)];
      EXPECT_EQ(sums[static_cast<std::size_t>(x)], 0.5F * static_cast<float>(sum)) << x;
    }
  });
}

TYPED_TEST(RowKernels, TransposedSamplesAreThoseOfTheRows) {
  on_every_instruction_set([&] {
    constexpr std::size_t stride = 48;
    std::vector<TypeParam> tile(tile_pixels * stride);
    transpose_rows(std::span<const TypeParam* const>(this->rows), this->left, tile.data(), stride);
    for (std::size_t p = 0; p < tile_pixels; ++p)
      for (std::size_t i = 0; i < this->rows.size(); ++i)
        EXPECT_EQ(tile[p * stride + i], this->values[i][p + static_cast<std::size_t>(this->left)]) << p << ", " << i;
  });
}

TYPED_TEST(RowKernels, ClippedSamplesAreCounted) {
  on_every_instruction_set([&] {
    const auto saturation = static_cast<TypeParam>(std::numeric_limits<TypeParam>::max() / 3);
    std::vector<std::uint8_t> counts(this->width, 7);
    counts[1] = 250;
    std::vector<unsigned> expected(counts.begin(), counts.end());
    for (int k = 0; k < 2; ++k) count_clipped_rows(std::span<const TypeParam* const>(this->rows), saturation, counts);
    for (std::size_t x = 0; x < counts.size(); ++x) {
      for (const auto& row : this->values) expected[x] += row[x] >= saturation ? 2 : 0;
      EXPECT_EQ(counts[x], std::min(expected[x], 255U)) << x;
    }
  });
}

TYPED_TEST(RowKernels, TheBlackLevelIsTakenOffAndTheHighestKnown) {
  on_every_instruction_set([&] {
    const auto& gray = this->values[7];
    std::vector<float> light(gray.size());
    for (const std::size_t count : {gray.size(), gray.size() - 3, std::size_t{1}}) {
      const float most = take_off(gray.data(), count, 2.5F, light.data());
      EXPECT_EQ(most, static_cast<float>(*std::max_element(gray.begin(), gray.begin() + static_cast<int>(count))));
      for (std::size_t i = 0; i < count; ++i) EXPECT_EQ(light[i], static_cast<float>(gray[i]) - 2.5F) << i;
    }
  });
}

/// The highest of some responses, as a plain loop over all of them finds it.
TEST(KeepHighest, RemembersTheHighestAndThoseBesideIt) {
  constexpr std::size_t count = 37;
  constexpr int places = 9;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  std::vector<std::vector<float>> blocks;
  for (int k = 0; k < places + 5; ++k) {
    blocks.emplace_back();
    for (std::size_t x = 0; x < count; ++x)
      blocks.back().push_back(
          std::round(20 * static_cast<float>(testing::uniform(9, 100 * x + static_cast<std::size_t>(k)))));
  }
  const auto place_at = [&](int k) {
    const auto row = [&](int i) { return blocks[static_cast<std::size_t>(i)].data(); };
    return Place{{row(k), row(k + 1)}, {row(k + 2), row(k + 3), row(k + 4), row(k + 5)}, k};
  };
  const auto response = [&](int k, std::size_t x) {
    const Place rows = place_at(k);
    return 2 * (rows.middle[0][x] + rows.middle[1][x]) -
           ((rows.side[0][x] + rows.side[1][x]) + (rows.side[2][x] + rows.side[3][x]));
  };
  on_every_instruction_set([&] {
    std::vector<float> rise(count, -std::numeric_limits<float>::infinity());
    std::vector<float> before(count, nan), after(count, nan);
    std::vector<std::int32_t> best(count, -1);
    for (const auto& [begin, end] : {std::pair{0, 4}, std::pair{4, 5}, std::pair{5, places}}) {
      std::vector<Place> step;
      for (int k = begin; k < end; ++k) step.push_back(place_at(k));
      const Place previous = place_at(std::max(0, begin - 1));
      keep_highest(begin > 0 ? &previous : nullptr, step, {rise.data(), before.data(), after.data(), best.data()},
                   count);
    }
    for (std::size_t x = 0; x < count; ++x) {
      int highest = 0;
      for (int k = 1; k < places; ++k)
        if (response(k, x) > response(highest, x)) highest = k;
      EXPECT_EQ(best[x], highest) << x;
      EXPECT_EQ(rise[x], response(highest, x)) << x;
      EXPECT_TRUE(highest == 0 ? std::isnan(before[x]) : before[x] == response(highest - 1, x)) << x;
      EXPECT_TRUE(highest + 1 == places ? std::isnan(after[x]) : after[x] == response(highest + 1, x)) << x;
    }
  });
}

TEST(ExtremesOf, AreThoseOfAllPixels) {
  std::vector<float> rise;
  std::vector<std::int32_t> best;
  for (std::size_t x = 0; x < 45; ++x) {
    rise.push_back(static_cast<float>(testing::uniform(3, x)));
    best.push_back(static_cast<std::int32_t>(100 * testing::uniform(4, x)));
  }
  on_every_instruction_set([&] {
    for (std::size_t count = 1; count <= rise.size(); ++count) {
      const Extremes extremes = extremes_of(rise.data(), best.data(), count);
      EXPECT_EQ(extremes.lowest_rise, *std::min_element(rise.begin(), rise.begin() + static_cast<int>(count)));
      EXPECT_EQ(extremes.latest_best, *std::max_element(best.begin(), best.begin() + static_cast<int>(count)));
    }
  });
}

}  // namespace
}  // namespace pagesweep
