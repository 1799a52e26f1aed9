// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/image_file.h"

#include <fmt/format.h>
#include <tiffio.h>

#include <vips/vips8>

#include "pagesweep/io/files_testing.h"

namespace pagesweep {
namespace {

using test::error_of;
using test::read_text;
using test::TestFolder;
using testing::AllOf;
using testing::HasSubstr;

template <class T>
Image<T> some_gray(int width, int height) {
  Image<T> image(width, height);
  unsigned state = 1;
  for (T& value : image.pixels()) value = static_cast<T>((state = state * 1664525 + 1013904223) >> 13);
  return image;
}

Picture some_picture(int channels, int bit_depth) {
  Picture picture = make_picture(37, 21, channels, bit_depth);
  if (bit_depth == 8)
    picture.samples = some_gray<std::uint8_t>(37 * channels, 21);
  else
    picture.samples = some_gray<std::uint16_t>(37 * channels, 21);
  return picture;
}

bool same_samples(const Picture& a, const Picture& b) {
  if (a.width() != b.width() || a.height() != b.height() || a.channels != b.channels) return false;
  if (a.samples.index() != b.samples.index()) return false;
  return std::visit(
      [&](const auto& samples) {
        return std::ranges::equal(samples.pixels(), std::get<std::decay_t<decltype(samples)>>(b.samples).pixels());
      },
      a.samples);
}

std::vector<std::byte> bytes_of(const std::string& text) {
  const auto* begin = reinterpret_cast<const std::byte*>(text.data());
  return {begin, begin + text.size()};
}

/// An EXIF blob with a maker and the orientation "turned by a quarter".
std::vector<std::byte> some_exif() {
  const std::string tiff("II*\0\x08\0\0\0", 8);
  const std::string entries("\2\0\x0f\1\2\0\x08\0\0\0\x26\0\0\0\x12\1\3\0\1\0\0\0\6\0\0\0\0\0\0\0", 30);
  return bytes_of(std::string("Exif\0\0", 6) + tiff + entries + std::string("Zeutsch\0", 8));
}

bool contains(const std::vector<std::byte>& blob, const std::string& text) {
  return std::string(reinterpret_cast<const char*>(blob.data()), blob.size()).find(text) != std::string::npos;
}

struct GrayTiff {
  int width = 33, height = 17, channels = 1, bits = 16;
  int compression = COMPRESSION_NONE, photometric = PHOTOMETRIC_MINISBLACK, sample_format = SAMPLEFORMAT_UINT;
  int tile = 0;  ///< side; 0: strips
};

/// Writes `image` with libtiff in the given layout.
void write_tiff(const std::filesystem::path& file, const GrayTiff& layout, const Image<std::uint16_t>& image) {
  TIFF* tiff = TIFFOpen(file.c_str(), "w");
  ASSERT_NE(tiff, nullptr);
  TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, layout.width);
  TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, layout.height);
  TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, layout.channels);
  TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, layout.bits);
  TIFFSetField(tiff, TIFFTAG_COMPRESSION, layout.compression);
  TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, layout.photometric);
  TIFFSetField(tiff, TIFFTAG_SAMPLEFORMAT, layout.sample_format);
  TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
  if (layout.tile > 0) {
    TIFFSetField(tiff, TIFFTAG_TILEWIDTH, layout.tile);
    TIFFSetField(tiff, TIFFTAG_TILELENGTH, layout.tile);
    for (int y0 = 0; y0 < layout.height; y0 += layout.tile)
      for (int x0 = 0; x0 < layout.width; x0 += layout.tile) {
        Image<std::uint16_t> tile(layout.tile, layout.tile);
        for (int y = 0; y < layout.tile; ++y)
          for (int x = 0; x < layout.tile; ++x)
            if (image.contains(x0 + x, y0 + y)) tile(x, y) = image(x0 + x, y0 + y);
        TIFFWriteTile(tiff, tile.data(), static_cast<std::uint32_t>(x0), static_cast<std::uint32_t>(y0), 0, 0);
      }
  } else {
    std::vector<std::uint16_t> row(
        static_cast<std::size_t>(std::max(layout.width, image.width()) * layout.channels * 2));
    TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, 5);
    for (int y = 0; y < layout.height; ++y) {
      std::ranges::copy(image.row(y), row.begin());
      TIFFWriteScanline(tiff, row.data(), static_cast<std::uint32_t>(y), 0);
    }
  }
  TIFFClose(tiff);
}

TEST(GrayImageFile, PngKeepsEveryGrayValue) {
  const TestFolder folder;
  for (const auto& [width, height] : {std::pair{37, 21}, std::pair{1, 1}, std::pair{300, 2}}) {
    const auto image8 = some_gray<std::uint8_t>(width, height);
    const auto image16 = some_gray<std::uint16_t>(width, height);
    write_gray_png(folder / "8.png", image8.view());
    write_gray_png(folder / "16.png", GrayImage(image16), 9);
    EXPECT_TRUE(std::ranges::equal(std::get<0>(read_gray(folder / "8.png")).pixels(), image8.pixels()));
    EXPECT_TRUE(std::ranges::equal(std::get<1>(read_gray(folder / "16.png")).pixels(), image16.pixels()));
  }
}

TEST(GrayImageFile, PngOfAViewSkipsTheRestOfItsRows) {
  const TestFolder folder;
  const auto image = some_gray<std::uint8_t>(20, 10);
  write_gray_png(folder / "part.png", ImageView<const std::uint8_t>(&image(3, 2), 5, 4, 20));
  const auto part = std::get<0>(read_gray(folder / "part.png"));
  ASSERT_EQ(part.width(), 5);
  EXPECT_EQ(part(4, 3), image(7, 5));
}

TEST(GrayImageFile, ReadsTiffOfAnyLayout) {
  const TestFolder folder;
  const auto image = some_gray<std::uint16_t>(33, 17);
  for (const int compression : {COMPRESSION_NONE, COMPRESSION_LZW, COMPRESSION_ADOBE_DEFLATE, COMPRESSION_PACKBITS})
    for (const int tile : {0, 16}) {
      write_tiff(folder / "a.tif", {.compression = compression, .tile = tile}, image);
      const GrayImage back = read_gray(folder / "a.tif", ImageSize{33, 17});
      EXPECT_TRUE(std::ranges::equal(std::get<1>(back).pixels(), image.pixels())) << compression << " " << tile;
    }
}

TEST(GrayImageFile, NamesWhatIsWrongWithATiff) {
  const TestFolder folder;
  const auto image = some_gray<std::uint16_t>(33, 17);
  const auto message = [&](const GrayTiff& layout) {
    write_tiff(folder / "a.tif", layout, image);
    return error_of([&] { read_gray(folder / "a.tif", ImageSize{33, 17}); });
  };
  EXPECT_THAT(message({.channels = 3, .photometric = PHOTOMETRIC_RGB}),
              HasSubstr("single gray channel as recorded, found 3"));
  EXPECT_THAT(message({.photometric = PHOTOMETRIC_MINISWHITE}), HasSubstr("white as 0"));
  EXPECT_THAT(message({.bits = 32}), HasSubstr("8 or 16 bit, found 32"));
  EXPECT_THAT(message({.sample_format = SAMPLEFORMAT_INT}), HasSubstr("signed"));
  EXPECT_THAT(message({.width = 32}),
              AllOf(HasSubstr("a.tif"), HasSubstr("expected 33 x 17 pixels"), HasSubstr("32 x 17")));
}

TEST(GrayImageFile, NamesWhatIsWrongWithAPng) {
  const TestFolder folder;
  write_picture(folder / "rgb.png", some_picture(3, 8));
  EXPECT_THAT(error_of([&] { read_gray(folder / "rgb.png"); }), AllOf(HasSubstr("rgb.png"), HasSubstr("found RGB")));
  write_bytes(folder / "text.png", "this is no picture");
  EXPECT_THAT(error_of([&] { read_gray(folder / "text.png"); }), HasSubstr("expected a PNG or TIFF"));
  write_bytes(folder / "empty.png", "");
  EXPECT_THAT(error_of([&] { read_gray(folder / "empty.png"); }), HasSubstr("it is empty"));
  EXPECT_THAT(error_of([&] { read_gray(folder / "absent.png"); }), HasSubstr("absent.png: cannot be read"));
}

TEST(GrayImageFile, NeverReadsBeyondAPngThatIsCutShort) {
  const TestFolder folder;
  write_gray_png(folder / "whole.png", some_gray<std::uint8_t>(64, 48).view());
  const std::string whole = read_text(folder / "whole.png");
  for (std::size_t length = 0; length < whole.size(); length += 1 + length / 40) {
    test::put(folder / "cut.png", std::string_view(whole).substr(0, length));
    EXPECT_THAT(error_of([&] { read_gray(folder / "cut.png"); }), HasSubstr("cut.png: cannot be read")) << length;
  }
}

TEST(GrayImageFile, NeverReadsBeyondATiffThatIsCutShort) {
  const TestFolder folder;
  for (const int compression : {COMPRESSION_NONE, COMPRESSION_LZW, COMPRESSION_ADOBE_DEFLATE})
    for (const int tile : {0, 16}) {
      write_tiff(folder / "whole.tif", {.compression = compression, .tile = tile}, some_gray<std::uint16_t>(33, 17));
      const std::string whole = read_text(folder / "whole.tif");
      for (std::size_t length = 0; length < whole.size(); length += 13) {
        test::put(folder / "cut.tif", std::string_view(whole).substr(0, length));
        EXPECT_THAT(error_of([&] { read_gray(folder / "cut.tif"); }), HasSubstr("cut.tif: cannot be read")) << length;
      }
    }
}

TEST(GrayImageFile, RefusesAPngThatPromisesMoreThanItHolds) {
  const TestFolder folder;
  write_gray_png(folder / "a.png", Image<std::uint8_t>(8, 8).view());
  std::string bytes = read_text(folder / "a.png");
  // 4 GB from 80 bytes.
  bytes.replace(12, 17, std::string("IHDR\0\0\xff\xff\0\0\xff\xff\x08\0\0\0\0", 17));
  write_bytes(folder / "bomb.png", test::with_checksums(bytes));
  EXPECT_THAT(error_of([&] { read_gray(folder / "bomb.png"); }), HasSubstr("cannot hold 65535 x 65535 pixels"));
  EXPECT_THAT(error_of([&] { read_gray(folder / "bomb.png", ImageSize{8, 8}); }), HasSubstr("expected 8 x 8 pixels"));
}

TEST(PictureFile, KeepsSamplesAndResolutionInEveryLosslessFormat) {
  const TestFolder folder;
  for (const char* name : {"a.png", "a.tif", "a.TIFF", "a.jp2"})
    for (const int channels : {1, 3})
      for (const int bit_depth : {8, 16}) {
        Picture picture = some_picture(channels, bit_depth);
        picture.pixels_per_mm = 11.811;
        write_picture(folder / name, picture);
        const Picture back = read_picture(folder / name);
        EXPECT_TRUE(same_samples(picture, back)) << name << " " << channels << " " << bit_depth;
        EXPECT_NEAR(back.pixels_per_mm, 11.811, 1e-4) << name;
      }
  EXPECT_EQ(folder.files(), 4u);
}

TEST(PictureFile, KeepsResolutionOfAJpeg) {
  const TestFolder folder;
  Picture picture = some_picture(3, 8);
  picture.pixels_per_mm = 400 / 25.4;
  write_picture(folder / "a.jpg", picture, {.jpeg_quality = 95});
  const Picture back = read_picture(folder / "a.jpg");
  EXPECT_EQ(back.channels, 3);
  EXPECT_NEAR(back.pixels_per_mm, 400 / 25.4, 0.01);
}

TEST(PictureFile, PacksTiffAsAsked) {
  const TestFolder folder;
  const Picture picture = make_picture(500, 500, 1, 8);
  std::vector<std::uintmax_t> sizes;
  for (const auto compression : {TiffCompression::none, TiffCompression::lzw, TiffCompression::deflate}) {
    write_picture(folder / "a.tif", picture, {.tiff_compression = compression});
    EXPECT_TRUE(same_samples(picture, read_picture(folder / "a.tif")));
    sizes.push_back(std::filesystem::file_size(folder / "a.tif"));
  }
  EXPECT_GT(sizes[0], 250'000u);
  EXPECT_LT(sizes[1], 25'000u);
  EXPECT_LT(sizes[2], 25'000u);
}

TEST(PictureFile, SaysThatResolutionIsUnknown) {
  const TestFolder folder;
  write_gray_png(folder / "a.png", some_gray<std::uint8_t>(9, 9).view());
  write_tiff(folder / "a.tif", {}, some_gray<std::uint16_t>(33, 17));
  EXPECT_EQ(read_picture(folder / "a.png").pixels_per_mm, 0);
  EXPECT_EQ(read_picture(folder / "a.tif").pixels_per_mm, 0);
}

TEST(PictureFile, KeepsProfileAndMetadata) {
  const TestFolder folder;
  Picture picture = some_picture(3, 8);
  // A profile that libvips ships.
  void* data = nullptr;
  std::size_t size = 0;
  VipsBlob* profile = nullptr;
  ASSERT_EQ(vips_profile_load("srgb", &profile, nullptr), 0);
  data = const_cast<void*>(vips_blob_get(profile, &size));
  picture.icc_profile = bytes_of(std::string(static_cast<const char*>(data), size));
  vips_area_unref(VIPS_AREA(profile));
  const auto xmp = bytes_of("<x:xmpmeta xmlns:x='adobe:ns:meta/'><title>Faust</title></x:xmpmeta>");
  picture.metadata = {{"exif", some_exif()}, {"xmp", xmp}};
  for (const char* name : {"a.png", "a.jpg", "a.tif", "a.jp2"}) {
    write_picture(folder / name, picture);
    EXPECT_EQ(read_picture(folder / name).icc_profile, picture.icc_profile) << name;
  }
  for (const char* name : {"a.png", "a.jpg", "a.tif"})
    EXPECT_TRUE(contains(read_picture(folder / name).metadata["xmp"], "Faust")) << name;
  for (const char* name : {"a.png", "a.jpg"})
    EXPECT_TRUE(contains(read_picture(folder / name).metadata["exif"], "Zeutsch")) << name;
}

TEST(PictureFile, WritesPagesUprightWhateverTheScansExifSays) {
  const TestFolder folder;
  Picture picture = some_picture(3, 8);
  picture.metadata = {{"exif", some_exif()}};
  for (const char* name : {"a.png", "a.jpg", "a.tif"}) {
    write_picture(folder / name, picture);
    const auto image = vips::VImage::new_from_file((folder / name).c_str());
    EXPECT_EQ(image.get_typeof("orientation") ? image.get_int("orientation") : 1, 1) << name;
  }
}

TEST(PictureFile, BlendsAlphaOverWhite) {
  const TestFolder folder;
  const std::uint8_t rgba[] = {10, 20, 30, 255, 10, 20, 30, 0};
  vips::VImage::new_from_memory(const_cast<std::uint8_t*>(rgba), 8, 2, 1, 4, VIPS_FORMAT_UCHAR)
      .copy(vips::VImage::option()->set("interpretation", VIPS_INTERPRETATION_sRGB))
      .pngsave((folder / "a.png").c_str());
  const Picture picture = read_picture(folder / "a.png");
  EXPECT_THAT(std::get<0>(picture.samples).pixels(), testing::ElementsAre(10, 20, 30, 255, 255, 255));
}

TEST(PictureFile, RefusesColoursThatItCannotKeep) {
  const TestFolder folder;
  const std::vector<std::uint8_t> inks(4 * 20 * 20, 100);
  vips::VImage::new_from_memory(const_cast<std::uint8_t*>(inks.data()), inks.size(), 20, 20, 4, VIPS_FORMAT_UCHAR)
      .copy(vips::VImage::option()->set("interpretation", VIPS_INTERPRETATION_CMYK))
      .tiffsave((folder / "a.tif").c_str());
  EXPECT_THAT(error_of([&] { read_picture(folder / "a.tif"); }), AllOf(HasSubstr("a.tif"), HasSubstr("cmyk")));
  write_tiff(folder / "b.tif", {.width = 16, .bits = 32, .sample_format = SAMPLEFORMAT_IEEEFP},
             some_gray<std::uint16_t>(16, 17));
  EXPECT_THAT(error_of([&] { read_picture(folder / "b.tif"); }), HasSubstr("8 or 16 bit, found float"));
}

TEST(PictureFile, NamesTheFileThatCannotBeRead) {
  const TestFolder folder;
  EXPECT_THAT(error_of([&] { read_picture(folder / "absent.png"); }), HasSubstr("absent.png: cannot be read"));
  EXPECT_THAT(error_of([&] { read_picture(folder.path()); }), HasSubstr("cannot be read"));
  write_bytes(folder / "a.svg", "<svg xmlns='http://www.w3.org/2000/svg' width='9' height='9'/>");
  EXPECT_THAT(error_of([&] { read_picture(folder / "a.svg"); }), HasSubstr("expected a PNG, TIFF, JPEG or JPEG 2000"));
  for (const char* name : {"a.png", "a.tif", "a.jpg", "a.jp2"}) {
    write_picture(folder / name, some_picture(3, 8));
    const std::string whole = read_text(folder / name);
    write_bytes(folder / name, std::string_view(whole).substr(0, whole.size() / 2));
    EXPECT_THAT(error_of([&] { read_picture(folder / name); }), HasSubstr(std::string(name) + ": cannot be read"));
  }
}

TEST(PictureFile, NamesTheFileThatCannotBeWritten) {
  const TestFolder folder;
  EXPECT_THAT(error_of([&] { write_picture(folder / "a.bmp", some_picture(1, 8)); }), HasSubstr("ends in .png, .tif"));
  EXPECT_THAT(error_of([&] { write_picture(folder / "a.jpg", some_picture(1, 16)); }), HasSubstr("a JPEG holds 8 bit"));
  write_bytes(folder / "file", "");
  for (const char* name : {"file/a.png", "file/a.tif", "file/a.jp2"})
    EXPECT_THAT(error_of([&] { write_picture(folder / name, some_picture(1, 8)); }), HasSubstr("cannot be written"));
  EXPECT_EQ(folder.files(), 1u);
}

}  // namespace
}  // namespace pagesweep
