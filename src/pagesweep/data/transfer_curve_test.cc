// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/data/transfer_curve.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <string_view>

namespace pagesweep {
namespace {

void append(std::vector<std::byte>& bytes, std::uint32_t number, int count) {
  for (int k = count - 1; k >= 0; --k) bytes.push_back(static_cast<std::byte>(number >> (8 * k)));
}
void append(std::vector<std::byte>& bytes, std::string_view text) {
  for (const char c : text) bytes.push_back(static_cast<std::byte>(c));
}

/// A picture with a profile of one red tone curve; `data` begins with its type.
Picture with_curve(const std::vector<std::byte>& data) {
  Picture picture = make_picture(2, 1, 3, 8);
  std::vector<std::byte>& profile = picture.icc_profile;
  profile.resize(128);
  append(profile, 1, 4);
  append(profile, "rTRC");
  append(profile, 144, 4);
  append(profile, static_cast<std::uint32_t>(data.size()), 4);
  profile.insert(profile.end(), data.begin(), data.end());
  return picture;
}
std::vector<std::byte> curve(std::uint32_t count, const std::vector<std::uint32_t>& values) {
  std::vector<std::byte> data;
  append(data, "curv");
  append(data, 0, 4);
  append(data, count, 4);
  for (const std::uint32_t value : values) append(data, value, 2);
  return data;
}

TEST(TransferCurve, IsThatOfTheProfile) {
  EXPECT_NEAR(TransferCurve::of(with_curve(curve(0, {}))).light(0.3), 0.3, 1e-6);
  EXPECT_NEAR(TransferCurve::of(with_curve(curve(1, {0x0233}))).light(0.5), std::pow(0.5, 2 + 51.0 / 256), 1e-5);
  EXPECT_NEAR(TransferCurve::of(with_curve(curve(3, {0, 13107, 65535}))).light(0.75), 0.6, 1e-4);
  std::vector<std::byte> para;
  append(para, "para");
  append(para, 0, 4);
  append(para, 3, 2);
  append(para, 0, 2);
  for (const double p : {2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045})
    append(para, static_cast<std::uint32_t>(std::lround(p * 65536)), 4);
  for (const double sample : {0.02, 0.2, 0.8})
    EXPECT_NEAR(TransferCurve::of(with_curve(para)).light(sample), TransferCurve().light(sample), 1e-4);
}

TEST(TransferCurve, SrgbStandsInForWhatIsNoProfile) {
  const TransferCurve srgb;
  EXPECT_NEAR(srgb.light(0.5), 0.21404, 1e-5);
  Picture broken = with_curve(curve(40000, {1, 2}));  // says that it is longer than it is
  EXPECT_EQ(TransferCurve::of(broken).light(0.5), srgb.light(0.5));
  for (std::size_t length = 0; length < broken.icc_profile.size(); length += 7) {
    Picture cut = broken;
    cut.icc_profile.resize(length);
    EXPECT_EQ(TransferCurve::of(cut).light(0.5), srgb.light(0.5)) << length;
  }
}

TEST(TransferCurve, EncodingIsTheInverse) {
  const TransferCurve srgb;
  for (int sample = 0; sample < 256; ++sample) EXPECT_NEAR(255 * srgb.sample(srgb.light(sample / 255.0)), sample, 0.01);
  EXPECT_EQ(srgb.table(8).size(), 256u);
  EXPECT_EQ(srgb.table(16).back(), 1.0f);
}

}  // namespace
}  // namespace pagesweep
