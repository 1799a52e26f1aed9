// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/delivery/pdf_document.h"

#include <cstdlib>
#include <regex>

#include "pagesweep/delivery/pdf_reader_testing.h"
#include "pagesweep/io/color_profile.h"
#include "pagesweep/io/files_testing.h"

namespace pagesweep {
namespace {

using test::PdfReader;
using test::read_text;
using test::TestFolder;
using testing::HasSubstr;

Picture some_picture(int width, int height, int channels) {
  Picture picture = make_picture(width, height, channels, 8);
  for (std::uint8_t& sample : std::get<0>(picture.samples).pixels()) sample = 230;
  picture.pixels_per_mm = 300 / 25.4;
  return picture;
}

/// Two words on a line that falls to the right, and one with letters from elsewhere.
TextPage some_text() {
  TextPage text{.width_px = 600, .height_px = 400, .pixels_per_mm = 300 / 25.4, .blocks = {}};
  TextLine first{{60, 100, 316, 149}, 0.01, -12, 44, {}}, second{{60, 200, 200, 240}, 0, -10, 40, {}};
  first.words = {{"Light", {60, 100, 180, 146}, 0.9}, {"falls", {196, 103, 316, 149}, 0.9}};
  second.words = {{"Grüße纸𝄞", {60, 200, 200, 240}, 0.9}};
  text.blocks = {{{60, 100, 420, 240}, {{{60, 100, 420, 240}, "eng", {first, second}}}}};
  return text;
}

/// A document of a coloured page with text and a gray one without.
std::string write(const std::filesystem::path& file, PdfImagePacking packing = PdfImagePacking::jpeg) {
  PdfDocument pdf(file, {"Faust <I>", "pagesweep test", "2026-11-22T18:00:00Z", 7});
  const TextPage text = some_text();
  pdf.add(make_pdf_image(some_picture(600, 400, 3), packing, 90), &text);
  pdf.add(make_pdf_image(some_picture(300, 500, 1), packing, 90), nullptr);
  pdf.finish();
  return read_text(file);
}

bool has_program(const std::string& name) { return std::system((name + " --version >/dev/null 2>&1").c_str()) == 0; }

/// The catalog and what it refers to, as ISO 19005-2 wants it; the clause stands beside each line.
TEST(PdfDocument, KeepsTheRulesOfPdfA2b) {
  const TestFolder folder;
  const std::string bytes = write(folder / "a.pdf");
  EXPECT_TRUE(bytes.starts_with("%PDF-1.7\n%"));  // 6.1.2
  for (std::size_t i = 10; i < 14; ++i) EXPECT_GT(static_cast<unsigned char>(bytes[i]), 127);
  EXPECT_TRUE(bytes.ends_with("%%EOF\n"));  // 6.1.3
  const PdfReader pdf(bytes);
  EXPECT_TRUE(std::regex_search(pdf.trailer(), std::regex("/ID \\[<[0-9A-F]{32}> <[0-9A-F]{32}>\\]")));
  EXPECT_THAT(pdf.trailer(), Not(HasSubstr("/Encrypt")));
  EXPECT_THAT(pdf.trailer(), Not(HasSubstr("/Info")));  // 6.6.3: cannot contradict the XMP
  const std::string catalog = pdf.object(PdfReader::reference(pdf.trailer(), "Root"));
  EXPECT_THAT(catalog, HasSubstr("/S /GTS_PDFA1"));  // 6.2.3
  const std::string intent = pdf.stream(PdfReader::reference(catalog, "DestOutputProfile"));
  EXPECT_EQ(intent.substr(12, 8), "mntrRGB ");
  EXPECT_LE(intent[8], 4);
  const int metadata = PdfReader::reference(catalog, "Metadata");
  EXPECT_THAT(pdf.object(metadata), Not(HasSubstr("/Filter")));                  // 6.6.2.1
  EXPECT_THAT(pdf.stream(metadata), HasSubstr("<pdfaid:part>2</pdfaid:part>"));  // 6.6.4
  EXPECT_THAT(pdf.stream(metadata), HasSubstr("<pdfaid:conformance>B</pdfaid:conformance>"));
  EXPECT_THAT(pdf.stream(metadata), HasSubstr("Faust &lt;I&gt;"));
  for (const char* forbidden :
       {"/JavaScript", "/Launch", "/EmbeddedFile", "/LZWDecode", "/Encrypt", "/Interpolate true", "/OpenAction", "/AA ",
        "/F (", "/DeviceRGB", "/DeviceGray", "/TR ", "/OPI", "/Alternates"})
    for (int object = 1; object <= pdf.objects(); ++object)
      EXPECT_THAT(pdf.object(object), Not(HasSubstr(forbidden))) << object;
}

TEST(PdfDocument, EmbedsTheFontOfItsText) {
  const TestFolder folder;
  const PdfReader pdf(write(folder / "a.pdf"));
  int type0 = 0;
  for (int object = 1; object <= pdf.objects(); ++object)
    if (pdf.object(object).find("/Subtype /Type0") != std::string::npos) type0 = object;
  ASSERT_GT(type0, 0);
  const std::string font = pdf.object(type0);
  EXPECT_THAT(font, HasSubstr("/Encoding /Identity-H"));
  const std::string descendant = pdf.object(std::stoi(font.substr(font.find("/DescendantFonts [") + 18)));
  const std::string descriptor = pdf.object(PdfReader::reference(descendant, "FontDescriptor"));
  const std::string file = pdf.stream(PdfReader::reference(descriptor, "FontFile2"));
  std::uint32_t sum = 0;
  for (std::size_t i = 0; i < file.size(); i += 4)
    for (std::size_t k = 0; k < 4; ++k)
      sum += static_cast<std::uint32_t>(static_cast<unsigned char>(file.at(i + k))) << (24 - 8 * k);
  EXPECT_EQ(sum, 0xB1B0AFBAu);  // of a TrueType file as a whole
  EXPECT_THAT(pdf.stream(PdfReader::reference(font, "ToUnicode")), HasSubstr("<D834DD1E>"));
}

TEST(PdfDocument, ImagesAreInTheirOwnColours) {
  const TestFolder folder;
  for (const auto packing : {PdfImagePacking::jpeg, PdfImagePacking::jp2}) {
    const PdfReader pdf(write(folder / "a.pdf", packing));
    int images = 0;
    for (int object = 1; object <= pdf.objects(); ++object) {
      const std::string entries = pdf.object(object);
      if (entries.find("/Subtype /Image") == std::string::npos) continue;
      ++images;
      const int profile = std::stoi(entries.substr(entries.find("/ICCBased ") + 10));
      const bool is_gray = entries.find("/Width 300 ") != std::string::npos;
      EXPECT_THAT(pdf.object(profile), HasSubstr(is_gray ? "/N 1" : "/N 3"));
      EXPECT_EQ(pdf.stream(profile).substr(16, 4), is_gray ? "GRAY" : "RGB ");
      EXPECT_EQ(pdf.stream(object).substr(0, 2) == "\xFF\xD8", packing == PdfImagePacking::jpeg);
    }
    EXPECT_EQ(images, 2);
  }
}

TEST(PdfDocument, TheSamePagesGiveTheSameFileAndOthersAnotherId) {
  const TestFolder folder;
  EXPECT_EQ(write(folder / "a.pdf"), write(folder / "b.pdf"));
  EXPECT_NE(PdfReader(write(folder / "a.pdf")).trailer(),
            PdfReader(write(folder / "b.pdf", PdfImagePacking::jp2)).trailer());
}

TEST(PdfDocument, IsSoundForQpdf) {
  if (!has_program("qpdf")) GTEST_SKIP() << "qpdf is not installed";
  const TestFolder folder;
  for (const auto packing : {PdfImagePacking::jpeg, PdfImagePacking::jp2}) {
    write(folder / "a.pdf", packing);
    EXPECT_EQ(std::system(("qpdf --check '" + (folder / "a.pdf").string() + "' >/dev/null").c_str()), 0);
  }
}

/// Poppler finds each word where its box is: across exactly, upright as high as the line's letters and on its baseline.
TEST(PdfDocument, WordsStandWhereTheyStandOnThePage) {
  if (std::system("pdftotext -v >/dev/null 2>&1") != 0) GTEST_SKIP() << "pdftotext is not installed";
  const TestFolder folder;
  write(folder / "a.pdf");
  const std::string out = (folder / "words.html").string();
  ASSERT_EQ(std::system(("pdftotext -bbox '" + (folder / "a.pdf").string() + "' '" + out + "'").c_str()), 0);
  const std::string html = read_text(out);
  std::vector<TextWord> found;
  const std::regex word(R"re(xMin="([\d.]+)" yMin="([\d.]+)" xMax="([\d.]+)" yMax="([\d.]+)">([^<]*)<)re");
  const double px = 300 / 72.0;
  for (std::sregex_iterator match(html.begin(), html.end(), word), end; match != end; ++match) {
    const auto at = [&](std::size_t i) { return px * std::stod((*match)[i]); };
    found.push_back({(*match)[5], {at(1), at(2), at(3), at(4)}, 0});
  }
  std::vector<std::pair<TextWord, double>> expected;  // and their baselines
  for_each_line(some_text(), [&](const TextLine& line) {
    for (const TextWord& each : line.words) expected.emplace_back(each, line.baseline_at(each.box.left));
  });
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    const auto& [wanted, baseline] = expected[i];
    EXPECT_EQ(found[i].text, wanted.text);
    EXPECT_NEAR(found[i].box.left, wanted.box.left, 0.5);  // turned by 0.01, letters 44 px high lean over by 0.4
    EXPECT_NEAR(found[i].box.right, wanted.box.right, 0.5);
    EXPECT_LT(found[i].box.top, baseline - 20);
    EXPECT_GT(found[i].box.bottom, baseline);
    EXPECT_LT(found[i].box.bottom, baseline + 14);
  }
}

TEST(PdfDocument, WithoutAPageThereIsNone) {
  const TestFolder folder;
  PdfDocument pdf(folder / "a.pdf", {"", "", "", 1});
  EXPECT_THROW(pdf.finish(), std::invalid_argument);
}

}  // namespace
}  // namespace pagesweep
