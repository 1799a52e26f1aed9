// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <hwy/targets.h>
#include <vector>

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
  ~RowKernels() override { hwy::SetSupportedTargetsForTest(0); }

  template <class Body>
  static void on_every_target(const Body& body) {
    for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
      SCOPED_TRACE(hwy::TargetName(target));
      hwy::SetSupportedTargetsForTest(target);
      body();
    }
  }
};

using Depths = ::testing::Types<std::uint8_t, std::uint16_t>;
TYPED_TEST_SUITE(RowKernels, Depths);

TYPED_TEST(RowKernels, SumsAreExact) {
  this->on_every_target([&] {
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
  this->on_every_target([&] {
    constexpr std::size_t stride = 48;
    std::vector<float> tile(tile_pixels * stride);
    std::array<float, tile_pixels> most;
    transpose_rows(std::span<const TypeParam* const>(this->rows), this->left, 2.0F, tile.data(), stride, most.data());
    for (std::size_t p = 0; p < tile_pixels; ++p) {
      float highest = 0;
      for (std::size_t i = 0; i < this->rows.size(); ++i) {
        const auto gray = static_cast<float>(this->values[i][p + static_cast<std::size_t>(this->left)]);
        EXPECT_EQ(tile[p * stride + i], gray - 2) << p << ", " << i;
        highest = std::max(highest, gray);
      }
      EXPECT_EQ(most[p], highest);
    }
  });
}

}  // namespace
}  // namespace pagesweep
