// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/ocr/hocr.h"

#include <iterator>
#include <random>

#include "pagesweep/io/files_testing.h"

namespace pagesweep {
namespace {

using test::error_of;
using test::replaced;
using testing::HasSubstr;

TextPage some_page() {
  TextPage page{.width_px = 800, .height_px = 600, .pixels_per_mm = 300 / 25.4, .blocks = {}};
  TextLine first{{20, 30, 220, 60}, 0.002, -7.5, 31.5, {}};
  first.words = {{"Fish", {20, 30, 90, 58}, 0.96}, {"<&>", {100, 31, 150, 60}, 0.5}, {"Grüße", {160, 30, 220, 60}, 1}};
  TextLine second{{20, 70, 90, 100}, 0, -6, 0, {{"end.", {20, 70, 90, 100}, 0.9}}};
  page.blocks = {{{20, 30, 220, 100}, {{{20, 30, 220, 100}, "eng", {first, second}}}}};
  page.blocks.push_back({{300, 400, 500, 440}, {{{300, 400, 500, 440}, "deu", {second}}}});
  return page;
}

std::string some_hocr() { return format_hocr(some_page(), {"A \"title\"", "page & 1.png", "test 1.0"}); }

TEST(Hocr, ComesBackAsItWasWritten) {
  const TextPage page = parse_hocr(some_hocr(), "a.hocr"), truth = some_page();
  EXPECT_EQ(page.width_px, 800);
  EXPECT_EQ(page.height_px, 600);
  EXPECT_NEAR(page.pixels_per_mm, truth.pixels_per_mm, 1e-9);
  EXPECT_EQ(plain_text(page), plain_text(truth));
  ASSERT_EQ(page.blocks.size(), 2u);
  EXPECT_EQ(page.blocks[1].paragraphs[0].language, "deu");
  const TextLine& line = page.blocks[0].paragraphs[0].lines[0];
  EXPECT_DOUBLE_EQ(line.baseline_at(120), 60 - 7.5 + 0.2);
  EXPECT_DOUBLE_EQ(line.size_px, 31.5);
  EXPECT_EQ(line.words[1].text, "<&>");
  EXPECT_DOUBLE_EQ(line.words[1].box.right, 150);
  EXPECT_DOUBLE_EQ(line.words[0].confidence, 0.96);
}

TEST(Hocr, ReadsWhatTesseractWrites) {
  const TextPage page = parse_hocr(
      "<html><body><div class='ocr_page' title='image \"x; y.png\"; bbox 0 0 100 50; ppageno 0'>"
      "<div class='ocr_photo' title='bbox 1 1 2 2'></div>"
      "<div class='ocr_carea' title='bbox 5 5 90 20'><p class='ocr_par' lang='eng' title='bbox 5 5 90 20'>"
      "<span class='ocr_header' title='bbox 5 5 90 20; baseline 0 -3; x_size 14.5; x_descenders 3; x_ascenders 4'>\n"
      " <span class='ocrx_word' id='w' title='bbox 5 5 40 20; x_wconf 91'><strong>Bold</strong></span>\n"
      " <span class='ocrx_word' id='v' title='bbox 50 5 90 20; x_wconf 9'> "
      "</span></span></p></div></div></body></html>",
      "t.hocr");
  EXPECT_EQ(plain_text(page), "Bold\n");
  EXPECT_DOUBLE_EQ(page.blocks.at(0).paragraphs.at(0).lines.at(0).size_px, 14.5);
}

TEST(Hocr, NamesWhatIsWrong) {
  const auto message = [](const std::string& text) { return error_of([&] { parse_hocr(text, "bad.hocr"); }); };
  EXPECT_THAT(message("<html><p></html>"), HasSubstr("bad.hocr: byte"));
  EXPECT_THAT(message("<html></html>"), HasSubstr("no \"ocr_page\""));
  EXPECT_THAT(message(replaced(some_hocr(), "bbox 20 30 90 58", "bbox 20 30 90")), HasSubstr("ocrx_word_1: expected"));
  EXPECT_THAT(message(replaced(some_hocr(), "bbox 20 30 90 58", "bbox 95 30 90 58")), HasSubstr("ends before"));
}

TEST(Hocr, NeverCrashesOnATextThatIsCutShort) {
  const std::string whole = some_hocr();
  for (std::size_t length = 0; length + 20 < whole.size(); length += 7)
    EXPECT_NE(error_of([&] { parse_hocr(whole.substr(0, length), "cut.hocr"); }), "") << length;
}

TEST(Hocr, ReadsOrRefusesATextThatWasChanged) {
  const std::string whole = some_hocr();
  const std::string pieces[] = {"-", "1e308", "nan", "<", "'", "99999999", "&#0;", ""};
  std::mt19937 random(1);
  int refused = 0;
  for (int round = 0; round < 500; ++round) {
    std::string changed = whole;
    for (int change = 0; change < 2; ++change)
      changed.replace(random() % changed.size(), random() % 9, pieces[random() % std::size(pieces)]);
    refused += !error_of([&] { parse_hocr(changed, "changed.hocr"); }).empty();
  }
  EXPECT_GT(refused, 50);
}

}  // namespace
}  // namespace pagesweep
