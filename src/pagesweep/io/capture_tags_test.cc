// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/capture_tags.h"

#include <gtest/gtest.h>

namespace pagesweep {
namespace {

CaptureTags some_tags() {
  return {.description = "",
          .make = "Lumen",
          .model = "XL",
          .software = "scan 2",
          .date_time = "2026:11:22 18:04:00",
          .artist = "Ö",
          .copyright = "public domain"};
}

TEST(CaptureTags, ComeBackFromExif) {
  const CaptureTags tags = read_exif(make_exif(some_tags()));
  EXPECT_EQ(tags.make, "Lumen");
  EXPECT_EQ(tags.model, "XL");
  EXPECT_EQ(tags.date_time, "2026:11:22 18:04:00");
  EXPECT_EQ(tags.artist, "Ö");
  EXPECT_EQ(tags.copyright, "public domain");
  EXPECT_EQ(tags.description, "");
}

TEST(CaptureTags, NothingIsReadBeyondAnExifThatIsCutOrChanged) {
  const auto whole = make_exif(some_tags());
  for (std::size_t length = 0; length < whole.size(); ++length) {
    const std::vector<std::byte> cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(length));  // own memory
    read_exif(cut);
    auto changed = whole;
    changed[length] = std::byte{0xFF};
    EXPECT_LT(read_exif(changed).copyright.size(), whole.size()) << length;
  }
  EXPECT_TRUE(read_exif({}).empty());
}

TEST(CaptureTags, DatesOfExifBecomeIsoDates) {
  EXPECT_EQ(iso_date("2026:11:22 18:04:00"), "2026-11-22T18:04:00");
  EXPECT_EQ(iso_date("    :  :     :  :  "), "");
  EXPECT_EQ(iso_date("2026"), "");
}

}  // namespace
}  // namespace pagesweep
