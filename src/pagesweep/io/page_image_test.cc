// SPDX-License-Identifier: Apache-2.0
// Finished pages as their files show them: the boxes, markers and tags that archives look for, read byte by byte.
#include <tiffio.h>

#include <map>
#include <pugixml.hpp>
#include <vips/vips8>

#include "pagesweep/io/color_profile.h"
#include "pagesweep/io/files_testing.h"
#include "pagesweep/io/image_codecs.h"
#include "pagesweep/io/image_file.h"
#include "pagesweep/io/page_metadata.h"
#include "pagesweep/io/xmp.h"

namespace pagesweep {
namespace {

using test::read_text;
using test::TestFolder;
using testing::ElementsAre;
using testing::HasSubstr;

std::vector<std::byte> bytes_of(const std::string& text) {
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

std::uint32_t number(std::string_view bytes, std::size_t at, std::size_t count) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < count; ++i) value = value << 8 | static_cast<unsigned char>(bytes.at(at + i));
  return value;
}

/// A page as write_pages() makes it from a scan of a scanner that says who it is.
Picture some_page(int channels = 3, int bit_depth = 8) {
  Picture page = make_picture(300, 200, channels, bit_depth);
  std::visit(
      [](auto& samples) {
        for (std::size_t i = 0; i < samples.size(); ++i) samples.data()[i] = i * 7 % 251;
      },
      page.samples);
  page.pixels_per_mm = 400 / 25.4;
  page.metadata["exif"] = make_exif({.description = "",
                                     .make = "Lumen",
                                     .model = "XL 3",
                                     .software = "",
                                     .date_time = "2026:11:22 18:04:00",
                                     .artist = "",
                                     .copyright = ""});
  complete_profile(page);
  complete_metadata(page, {.title = "Faust <I>, page 7", .source = "faust", .program = "pagesweep test"});
  return page;
}

std::string xmp_of(const Picture& picture) {
  const auto& blob = picture.metadata.at("xmp");
  return {reinterpret_cast<const char*>(blob.data()), blob.size()};
}

/// Types of the boxes in a row of JPEG 2000 boxes, and their contents.
std::vector<std::pair<std::string, std::string>> boxes_of(std::string_view row) {
  std::vector<std::pair<std::string, std::string>> boxes;
  while (row.size() >= 8) {
    std::size_t length = number(row, 0, 4);
    if (length == 0) length = row.size();
    boxes.emplace_back(row.substr(4, 4), row.substr(8, length - 8));
    row.remove_prefix(length);
  }
  return boxes;
}

std::string content_of(const std::string& type, const std::vector<std::pair<std::string, std::string>>& boxes) {
  for (const auto& [name, content] : boxes)
    if (name == type) return content;
  ADD_FAILURE() << "no box " << type;
  return "";
}

TEST(PageImage, EveryFormatTellsResolutionProfileAndMetadata) {
  const TestFolder folder;
  for (const int channels : {1, 3})
    for (const char* name : {"a.png", "a.tif", "a.jpg", "a.jp2"}) {
      const Picture page = some_page(channels);
      write_picture(folder / name, page);
      const Picture back = read_picture(folder / name);
      EXPECT_NEAR(back.pixels_per_mm * 25.4, 400, 0.02) << name;
      EXPECT_EQ(back.icc_profile, page.icc_profile) << name;
      pugi::xml_document xmp;
      ASSERT_TRUE(xmp.load_string(xmp_of(back).c_str())) << name;
      EXPECT_THAT(xmp_of(back), HasSubstr("<tiff:Model>XL 3</tiff:Model>")) << name;
      EXPECT_THAT(xmp_of(back), HasSubstr("<xmp:CreateDate>2026-11-22T18:04:00</xmp:CreateDate>")) << name;
      EXPECT_THAT(xmp_of(back), HasSubstr("Faust &lt;I&gt;, page 7")) << name;
    }
}

TEST(PageImage, Jpeg2000HasTheBoxesOfPart1InTheirOrder) {
  const TestFolder folder;
  write_picture(folder / "a.jp2", some_page());
  const auto boxes = boxes_of(read_text(folder / "a.jp2"));
  std::vector<std::string> types;
  for (const auto& [type, content] : boxes) types.push_back(type);
  EXPECT_THAT(types, ElementsAre("jP  ", "ftyp", "jp2h", "uuid", "jp2c"));
  EXPECT_EQ(content_of("ftyp", boxes).substr(0, 4), "jp2 ");
  const auto header = boxes_of(content_of("jp2h", boxes));
  EXPECT_EQ(header.at(0).first, "ihdr");  // must be the first
  const std::string size = header[0].second;
  EXPECT_EQ(number(size, 0, 4), 200u);  // height, width, components, depth - 1, compression 7, colours known
  EXPECT_EQ(number(size, 4, 4), 300u);
  EXPECT_EQ(number(size, 8, 2), 3u);
  EXPECT_EQ(number(size, 10, 1), 7u);
  EXPECT_EQ(number(size, 11, 1), 7u);
  const std::string color = content_of("colr", header);
  EXPECT_EQ(number(color, 0, 1), 2u);  // restricted ICC
  EXPECT_EQ(bytes_of(color.substr(3)), make_srgb_profile());
  const std::string resolution = content_of("resc", boxes_of(content_of("res ", header)));
  const double per_m = double(number(resolution, 0, 2)) / number(resolution, 2, 2) * std::pow(10, resolution[8]);
  EXPECT_NEAR(per_m, 400 / 0.0254, 0.5);
}

TEST(PageImage, Jpeg2000IsPackedAsArchivesAsk) {
  const std::string jp2 = encode_jp2(some_page(3, 16));
  const std::string stream = content_of("jp2c", boxes_of(jp2));
  std::map<std::uint32_t, std::string> segments;  // of the main header, by marker
  for (std::size_t at = 2; number(stream, at, 2) != 0xFF90; at += 2 + number(stream, at + 2, 2))
    segments[number(stream, at, 2)] = stream.substr(at + 4, number(stream, at + 2, 2) - 2);
  ASSERT_TRUE(segments.contains(0xFF52) && segments.contains(0xFF51));
  EXPECT_EQ(number(segments[0xFF51], 0, 2), 0u);     // SIZ: no extensions
  EXPECT_EQ(number(segments[0xFF51], 18, 4), 300u);  // one tile
  const std::string coding = segments[0xFF52];       // COD
  EXPECT_EQ(number(coding, 0, 1), 7u);               // own precincts, SOP, EPH
  EXPECT_EQ(number(coding, 1, 1), 2u);               // RPCL
  EXPECT_EQ(number(coding, 2, 2), 1u);               // one layer
  EXPECT_EQ(number(coding, 4, 1), 1u);               // reversible colour transform
  EXPECT_EQ(number(coding, 5, 1), 5u);               // decompositions
  EXPECT_EQ(number(coding, 6, 1), 4u);               // code blocks of 2^(4 + 2)
  EXPECT_EQ(number(coding, 7, 1), 4u);
  EXPECT_EQ(number(coding, 9, 1), 1u);      // 5-3, reversible
  EXPECT_EQ(number(coding, 10, 1), 0x77u);  // precincts, coarsest first
  EXPECT_EQ(number(coding, 15, 1), 0x88u);
  EXPECT_TRUE(segments.contains(0xFF55)) << "tile-part lengths";
}

TEST(PageImage, Jpeg2000OfTheSmallestPicturesCanBeRead) {
  const TestFolder folder;
  for (const auto& [width, height] : {std::pair{1, 1}, std::pair{2, 40}, std::pair{33, 3}}) {
    Picture picture = make_picture(width, height, 1, 8);
    std::get<0>(picture.samples)(0, 0) = 200;
    write_picture(folder / "a.jp2", picture);
    EXPECT_EQ(std::get<0>(read_picture(folder / "a.jp2").samples)(0, 0), 200);
  }
}

TEST(PageImage, TiffHasTheTagsOfTheScanner) {
  const TestFolder folder;
  write_picture(folder / "a.tif", some_page(), {.tiff_compression = TiffCompression::lzw});
  TIFF* tiff = TIFFOpen((folder / "a.tif").c_str(), "r");
  ASSERT_NE(tiff, nullptr);
  const char *make = nullptr, *model = nullptr, *date = nullptr;
  std::uint16_t compression = 0, predictor = 0, unit = 0, photometric = 0, orientation = 0;
  float resolution = 0;
  EXPECT_TRUE(TIFFGetField(tiff, TIFFTAG_MAKE, &make) && TIFFGetField(tiff, TIFFTAG_MODEL, &model));
  EXPECT_TRUE(TIFFGetField(tiff, TIFFTAG_DATETIME, &date));
  EXPECT_TRUE(TIFFGetField(tiff, TIFFTAG_COMPRESSION, &compression));
  EXPECT_TRUE(TIFFGetField(tiff, TIFFTAG_PREDICTOR, &predictor));
  EXPECT_TRUE(TIFFGetField(tiff, TIFFTAG_RESOLUTIONUNIT, &unit) &&
              TIFFGetField(tiff, TIFFTAG_XRESOLUTION, &resolution));
  EXPECT_TRUE(TIFFGetField(tiff, TIFFTAG_PHOTOMETRIC, &photometric));
  EXPECT_TRUE(TIFFGetField(tiff, TIFFTAG_ORIENTATION, &orientation));
  EXPECT_STREQ(make, "Lumen");
  EXPECT_STREQ(model, "XL 3");
  EXPECT_STREQ(date, "2026:11:22 18:04:00");
  EXPECT_EQ(compression, COMPRESSION_LZW);
  EXPECT_EQ(predictor, PREDICTOR_HORIZONTAL);
  EXPECT_EQ(unit, RESUNIT_INCH);
  EXPECT_FLOAT_EQ(resolution, 400);
  EXPECT_EQ(photometric, PHOTOMETRIC_RGB);
  EXPECT_EQ(orientation, ORIENTATION_TOPLEFT);
  TIFFClose(tiff);
}

TEST(PageImage, AGrayPageDoesNotTakeOverAProfileOfColours) {
  Picture page = make_picture(20, 20, 1, 8);
  page.icc_profile = make_srgb_profile();
  complete_profile(page);
  EXPECT_EQ(page.icc_profile, make_gray_profile());
  Picture colored = make_picture(20, 20, 3, 8);
  colored.icc_profile = make_srgb_profile();
  colored.icc_profile.back() = std::byte{1};  // the scan's own
  const auto own = colored.icc_profile;
  complete_profile(colored);
  EXPECT_EQ(colored.icc_profile, own);
}

/// What Little CMS makes of our profiles, against its own sRGB.
TEST(PageImage, ColoursUnderOurProfilesAreThoseOfSrgb) {
  const TestFolder folder;
  for (const int channels : {1, 3}) {
    Picture picture = make_picture(256, 1, channels, 8);
    auto& samples = std::get<0>(picture.samples);
    for (int x = 0; x < 256; ++x)
      for (int c = 0; c < channels; ++c) samples(channels * x + c, 0) = static_cast<std::uint8_t>(c == 1 ? 255 - x : x);
    complete_profile(picture);
    write_picture(folder / "a.tif", picture);
    const auto seen = vips::VImage::new_from_file((folder / "a.tif").c_str())
                          .icc_transform("srgb", vips::VImage::option()->set("embedded", true));
    for (int x = 0; x < 256; ++x) {
      const std::vector<double> pixel = seen.getpoint(x, 0);
      ASSERT_EQ(pixel.size(), 3u);
      for (std::size_t c = 0; c < 3; ++c)
        EXPECT_NEAR(pixel[c], channels == 3 && c == 1 ? 255 - x : x, 1.0) << channels << " " << x;
    }
  }
}

TEST(PageImage, SixteenBitBecomeTheNearestEight) {
  Picture fine = make_picture(3, 1, 1, 16);
  std::get<1>(fine.samples)(0, 0) = 65535;
  std::get<1>(fine.samples)(1, 0) = 257 * 77 + 128;
  std::get<1>(fine.samples)(2, 0) = 257 * 77 + 129;
  EXPECT_THAT(std::get<0>(with_8_bit(fine).samples).pixels(), ElementsAre(255, 77, 78));
}

TEST(Xmp, KeepsWhatTheScanSaidAndReplacesWhatIsNewer) {
  const std::string earlier = make_xmp({{"dc:title", "old", XmpKind::alternative}, {"dc:source", "shelf 7"}});
  const std::string xmp = make_xmp({{"dc:title", "new", XmpKind::alternative}, {"tiff:Make", ""}}, earlier);
  EXPECT_THAT(xmp, AllOf(HasSubstr("shelf 7"), HasSubstr("<rdf:li xml:lang=\"x-default\">new"), Not(HasSubstr("old"))));
  EXPECT_THAT(xmp, Not(HasSubstr("tiff:Make")));
  EXPECT_THAT(make_xmp({{"dc:source", "x"}}, "no <xml"), HasSubstr("<dc:source>x</dc:source>"));
  EXPECT_THROW(make_xmp({{"unknown:x", "y"}}), std::invalid_argument);
}

}  // namespace
}  // namespace pagesweep
