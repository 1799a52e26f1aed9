// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/base/image.h"

#include <gtest/gtest.h>

#include <cstdint>

namespace pagesweep {
namespace {

TEST(Image, IsRowMajorAndAligned) {
  Image<float> image(5, 3, 1.5f);
  image(4, 2) = 7;
  EXPECT_EQ(image.data()[2 * 5 + 4], 7);
  EXPECT_EQ(image.row(2)[4], 7);
  EXPECT_EQ(image(0, 0), 1.5f);
  EXPECT_EQ(reinterpret_cast<std::uintptr_t>(image.data()) % 64, 0u);
}

TEST(Image, CopiesAreDeepAndMovesAreNot) {
  Image<int> first(2, 2, 3);
  Image<int> copy = first;
  copy(0, 0) = 4;
  EXPECT_EQ(first(0, 0), 3);
  const int* pixels = first.data();
  const Image<int> moved = std::move(first);
  EXPECT_EQ(moved.data(), pixels);
}

TEST(Image, MayBeEmptyButNotNegative) {
  EXPECT_TRUE(Image<int>().empty());
  EXPECT_TRUE(Image<int>(0, 5).empty());
  EXPECT_THROW(Image<int>(-1, 5), std::invalid_argument);
}

TEST(ImageView, LooksAtAPartThroughItsStride) {
  Image<int> image(4, 4);
  ImageView<int> part(&image(1, 1), 2, 2, image.width());
  part(1, 1) = 9;
  EXPECT_EQ(image(2, 2), 9);
  EXPECT_TRUE(part.contains(1, 1));
  EXPECT_FALSE(part.contains(2, 1));
  const ImageView<const int> constant = part;
  EXPECT_EQ(constant.row(1)[1], 9);
}

}  // namespace
}  // namespace pagesweep
