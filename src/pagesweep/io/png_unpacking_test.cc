// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/png_unpacking_internal.h"

#include <gtest/gtest.h>
#include <png.h>

#include <algorithm>
#include <string>

#include "pagesweep/io/files_testing.h"
#include "pagesweep/io/png_file_internal.h"

namespace pagesweep {
namespace {

/// Smooth with noise, so that every filter predicts something and Paeth's takes each of its three choices.
template <class T>
Image<T> some_frame(int width, int height) {
  Image<T> image(width, height);
  unsigned state = 1;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      state = state * 1664525 + 1013904223;
      image(x, y) = static_cast<T>((1000 * x + 700 * y) * (sizeof(T) == 1 ? 0.01 : 1.0) + (state >> 27));
    }
  return image;
}

/// What libpng makes of a picture, with whatever of the filters it likes.
template <class T>
std::string pack(const Image<T>& image, int filters, int interlace) {
  std::string bytes;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  const auto write = [](png_structp self, png_bytep from, std::size_t count) {
    static_cast<std::string*>(png_get_io_ptr(self))->append(reinterpret_cast<const char*>(from), count);
  };
  png_set_write_fn(png, &bytes, write, [](png_structp) {});
  png_set_IHDR(png, info, static_cast<png_uint_32>(image.width()), static_cast<png_uint_32>(image.height()),
               8 * sizeof(T), PNG_COLOR_TYPE_GRAY, interlace, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_set_filter(png, PNG_FILTER_TYPE_BASE, filters);
  png_write_info(png, info);
  if (sizeof(T) == 2) png_set_swap(png);
  std::vector<png_bytep> rows;
  for (int y = 0; y < image.height(); ++y)
    rows.push_back(reinterpret_cast<png_bytep>(const_cast<T*>(image.row(y).data())));
  png_write_image(png, rows.data());
  png_write_end(png, nullptr);
  png_destroy_write_struct(&png, &info);
  return bytes;
}

template <class T>
class PngUnpacking : public testing::Test {};
using Depths = testing::Types<std::uint8_t, std::uint16_t>;
TYPED_TEST_SUITE(PngUnpacking, Depths);

TYPED_TEST(PngUnpacking, UndoesEveryFilter) {
  const auto frame = some_frame<TypeParam>(67, 41);
  for (const int filters : {PNG_FILTER_NONE, PNG_FILTER_SUB, PNG_FILTER_UP, PNG_FILTER_AVG, PNG_FILTER_PAETH,
                            static_cast<int>(PNG_ALL_FILTERS)}) {
    const auto unpacked = unpack_gray_png<TypeParam>(pack(frame, filters, PNG_INTERLACE_NONE), 67, 41);
    ASSERT_TRUE(unpacked) << filters;
    EXPECT_TRUE(std::ranges::equal(unpacked->pixels(), frame.pixels())) << filters;
  }
}

TYPED_TEST(PngUnpacking, LeavesInterlacedPicturesToLibpng) {
  const auto frame = some_frame<TypeParam>(67, 41);
  const GrayImage read = decode_gray_png(pack(frame, PNG_ALL_FILTERS, PNG_INTERLACE_ADAM7), "a.png", {});
  EXPECT_TRUE(std::ranges::equal(std::get<Image<TypeParam>>(read).pixels(), frame.pixels()));
}

TYPED_TEST(PngUnpacking, WantsAllBytesToBeSound) {
  const std::string sound = pack(some_frame<TypeParam>(67, 41), PNG_FILTER_SUB, PNG_INTERLACE_NONE);
  EXPECT_TRUE(unpack_gray_png<TypeParam>(sound, 67, 41));
  for (std::size_t k = 8; k < sound.size(); k += 7) {
    std::string changed = sound;
    changed[k] = static_cast<char>(changed[k] ^ 0x10);
    EXPECT_FALSE(unpack_gray_png<TypeParam>(changed, 67, 41)) << k;
    EXPECT_FALSE(unpack_gray_png<TypeParam>(sound.substr(0, k), 67, 41)) << k;
  }
  for (const auto& [width, height] : {std::pair(66, 41), std::pair(67, 42), std::pair(67, 40)})
    EXPECT_FALSE(unpack_gray_png<TypeParam>(sound, width, height));
}

TYPED_TEST(PngUnpacking, LetsLibpngSayWhatIsWrong) {
  std::string bytes = pack(some_frame<TypeParam>(67, 41), PNG_FILTER_SUB, PNG_INTERLACE_NONE);
  bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 1);
  EXPECT_THAT(test::error_of([&] { decode_gray_png(bytes, "a.png", {}); }),
              testing::HasSubstr("a.png: cannot be read: "));
}

}  // namespace
}  // namespace pagesweep
