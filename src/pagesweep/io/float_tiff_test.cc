// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/float_tiff.h"

#include <tiffio.h>

#include <cmath>

#include "pagesweep/data/time_map.h"
#include "pagesweep/io/files_testing.h"
#include "pagesweep/io/image_file.h"

namespace pagesweep {
namespace {

using test::error_of;
using test::read_text;
using test::TestFolder;
using testing::AllOf;
using testing::HasSubstr;

constexpr int width = 37, height = 150;

std::vector<Image<float>> some_channels(int count) {
  std::vector<Image<float>> channels;
  for (int c = 0; c < count; ++c) {
    Image<float>& image = channels.emplace_back(width, height);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) image(x, y) = std::sin(0.1F * static_cast<float>(x + 3 * y + 7 * c)) * 1e3F;
    image(c, 5) = not_a_number;
    image(c, 6) = std::numeric_limits<float>::infinity();
  }
  return channels;
}

void expect_same(const std::vector<Image<float>>& a, const std::vector<Image<float>>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t c = 0; c < a.size(); ++c) {
    ASSERT_EQ(std::pair(a[c].width(), a[c].height()), std::pair(b[c].width(), b[c].height()));
    EXPECT_EQ(std::memcmp(a[c].data(), b[c].data(), a[c].size() * sizeof(float)), 0) << "channel " << c;
  }
}

struct Layout {
  int compression = COMPRESSION_NONE;
  int planes = PLANARCONFIG_CONTIG;
  int tile = 0;  ///< side; 0: strips
  bool big_endian = false;
  int bits = 32;
  int predictor = PREDICTOR_NONE;
};

/// A row or tile's samples as the layout wants them: of one channel, or interleaved.
template <class T>
std::vector<T> block_of(const std::vector<Image<float>>& channels, int plane, int x0, int y0, int columns, int rows) {
  std::vector<T> block;
  for (int y = y0; y < y0 + rows; ++y)
    for (int x = x0; x < x0 + columns; ++x)
      for (int c = 0; c < static_cast<int>(channels.size()); ++c) {
        const auto& image = channels[static_cast<std::size_t>(c)];
        if (plane < 0 || plane == c) block.push_back(image.contains(x, y) ? static_cast<T>(image(x, y)) : 0);
      }
  return block;
}

template <class T>
void write_blocks(TIFF* tiff, const std::vector<Image<float>>& channels, const Layout& layout) {
  const bool separate = layout.planes == PLANARCONFIG_SEPARATE;
  for (int plane = 0; plane < (separate ? static_cast<int>(channels.size()) : 1); ++plane) {
    const int step_y = layout.tile ? layout.tile : 1;
    const int step_x = layout.tile ? layout.tile : width;
    for (int y = 0; y < height; y += step_y)
      for (int x = 0; x < width; x += step_x) {
        auto block = block_of<T>(channels, separate ? plane : -1, x, y, step_x, step_y);
        const auto [u, v, p] =
            std::tuple(static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y), static_cast<std::uint16_t>(plane));
        if (layout.tile)
          TIFFWriteTile(tiff, block.data(), u, v, 0, p);
        else
          TIFFWriteScanline(tiff, block.data(), v, p);
      }
  }
}

void write_with_libtiff(const std::filesystem::path& file, const std::vector<Image<float>>& channels,
                        const Layout& layout) {
  TIFF* tiff = TIFFOpen(file.c_str(), layout.big_endian ? "wb" : "wl");
  ASSERT_NE(tiff, nullptr);
  TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, width);
  TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, height);
  TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, static_cast<int>(channels.size()));
  TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, layout.bits);
  TIFFSetField(tiff, TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_IEEEFP);
  TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, layout.planes);
  TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
  TIFFSetField(tiff, TIFFTAG_COMPRESSION, layout.compression);
  if (layout.predictor != PREDICTOR_NONE) TIFFSetField(tiff, TIFFTAG_PREDICTOR, layout.predictor);
  if (layout.tile) {
    TIFFSetField(tiff, TIFFTAG_TILEWIDTH, layout.tile);
    TIFFSetField(tiff, TIFFTAG_TILELENGTH, layout.tile);
  } else {
    TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, 7);
  }
  if (layout.bits == 64)
    write_blocks<double>(tiff, channels, layout);
  else
    write_blocks<float>(tiff, channels, layout);
  TIFFClose(tiff);
}

TEST(FloatTiff, KeepsEveryBitOfAnyNumberOfChannels) {
  const TestFolder folder;
  for (const int count : {1, 2, 3, 4, 6}) {
    const auto channels = some_channels(count);
    std::vector<ImageView<const float>> views;
    for (const auto& channel : channels) views.push_back(channel.view());
    write_float_tiff(folder / "a.tiff", views);
    expect_same(read_float_tiff(folder / "a.tiff", count), channels);
  }
}

TEST(FloatTiff, ReadsWhatOtherProgramsWrite) {
  const TestFolder folder;
  for (const int count : {1, 2, 3, 6}) {
    const auto channels = some_channels(count);
    for (const int compression : {COMPRESSION_NONE, COMPRESSION_LZW, COMPRESSION_ADOBE_DEFLATE})
      for (const int planes : {PLANARCONFIG_CONTIG, PLANARCONFIG_SEPARATE})
        for (const int tile : {0, 32}) {
          SCOPED_TRACE(testing::Message() << count << " channels, compression " << compression << ", planes " << planes
                                          << ", tile " << tile);
          // libtiff 4.5 writes the predictor wrongly in the byte order that is not the machine's: not both at once.
          const bool packed = compression != COMPRESSION_NONE;
          const Layout plain{.compression = compression, .planes = planes, .tile = tile};
          Layout big_endian = plain, predicted = plain;
          big_endian.big_endian = true;
          predicted.predictor = packed ? PREDICTOR_FLOATINGPOINT : PREDICTOR_NONE;
          for (const Layout& layout : {plain, big_endian, predicted}) {
            write_with_libtiff(folder / "a.tif", channels, layout);
            expect_same(read_float_tiff(folder / "a.tif"), channels);
          }
        }
  }
  write_with_libtiff(folder / "a.tif", some_channels(3), {.bits = 64});
  expect_same(read_float_tiff(folder / "a.tif"), some_channels(3));
}

TEST(FloatTiff, KeepsVectorsAndScanMaps) {
  const TestFolder folder;
  Image<Eigen::Vector3f> vectors(9, 4, Eigen::Vector3f::Zero());
  vectors(3, 2) = {1, 2, 3};
  write_vector_tiff(folder / "points.tiff", vectors);
  EXPECT_EQ(read_vector_tiff(folder / "points.tiff")(3, 2), Eigen::Vector3f(1, 2, 3));
  ScanMap map(5, 6);
  map.u(4, 5) = 100.25F;
  map.v(4, 5) = 200.5F;
  write_scan_map(folder / "map.tiff", map);
  const ScanMap back = read_scan_map(folder / "map.tiff");
  EXPECT_EQ(std::pair(back.u(4, 5), back.v(4, 5)), std::pair(100.25F, 200.5F));
  EXPECT_TRUE(std::isnan(back.u(0, 0)));
  EXPECT_THAT(error_of([&] { read_scan_map(folder / "points.tiff"); }),
              AllOf(HasSubstr("points.tiff"), HasSubstr("expected 2 channels, found 3")));
}

TEST(FloatTiff, RefusesWhatIsNoFloatTiff) {
  const TestFolder folder;
  write_picture(folder / "a.tif", make_picture(9, 9, 1, 16));
  EXPECT_THAT(error_of([&] { read_float_tiff(folder / "a.tif"); }),
              AllOf(HasSubstr("a.tif"), HasSubstr("expected floating point samples"), HasSubstr("16 bit")));
  write_bytes(folder / "b.tif", "hello");
  EXPECT_THAT(error_of([&] { read_float_tiff(folder / "b.tif"); }), HasSubstr("b.tif: cannot be read: it is no TIFF"));
  EXPECT_THAT(error_of([&] { read_float_tiff(folder / "c.tif"); }), HasSubstr("c.tif: cannot be read"));
}

TEST(FloatTiff, NeverReadsBeyondAFileThatIsCutShort) {
  const TestFolder folder;
  const auto channels = some_channels(2);
  write_float_tiff(folder / "whole.tiff", {channels[0].view(), channels[1].view()});
  const std::string whole = read_text(folder / "whole.tiff");
  for (std::size_t length = 0; length < whole.size(); length += 1 + length / 30) {
    test::put(folder / "cut.tiff", std::string_view(whole).substr(0, length));
    EXPECT_THAT(error_of([&] { read_float_tiff(folder / "cut.tiff"); }), HasSubstr("cut.tiff: cannot be read"));
  }
}

TEST(FloatTiff, RefusesCallersMistakes) {
  const TestFolder folder;
  const Image<float> a(3, 3), b(4, 3);
  EXPECT_THROW(write_float_tiff(folder / "a.tiff", {a.view(), b.view()}), std::invalid_argument);
  EXPECT_THROW(write_float_tiff(folder / "a.tiff", {}), std::invalid_argument);
  EXPECT_EQ(folder.files(), 0u);
}

}  // namespace
}  // namespace pagesweep
