// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/data/status.h"

#include <gtest/gtest.h>

namespace pagesweep {
namespace {

TEST(PixelStatus, EveryValueHasItsName) {
  EXPECT_EQ(name_of(PixelStatus::ok), "ok");
  EXPECT_EQ(name_of(PixelStatus::hidden), "hidden");
  EXPECT_EQ(value_named<PixelStatus>("off_surface"), PixelStatus::off_surface);
  EXPECT_EQ(value_named<PixelStatus>("no such"), std::nullopt);
  EXPECT_EQ(names_of(PixelStatus{}).size(), static_cast<std::size_t>(PixelStatus::covered) + 1);
}

}  // namespace
}  // namespace pagesweep
