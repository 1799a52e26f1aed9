// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/ocr/recognise_text.h"

#include "pagesweep/io/files_testing.h"
#include "pagesweep/ocr/typeset_page_testing.h"

namespace pagesweep {
namespace {

using test::error_of;
using testing::HasSubstr;

class RecogniseText : public testing::Test {
 protected:
  void SetUp() override {
    if (!TextRecogniser::is_installed()) GTEST_SKIP() << "tesseract is not installed";
  }
};

TEST_F(RecogniseText, ReadsCleanPrintWithoutAMistake) {
  const std::string text = "Light wanders over the page.";
  for (const int channels : {1, 3}) {
    const auto page = test::typeset_page(text, channels);
    const TextPage found = TextRecogniser("eng")(page.picture);
    EXPECT_EQ(plain_text(found), text + "\n");
    EXPECT_EQ(found.width_px, page.picture.width());
  }
}

/// Where ink is, boxes are: every dark pixel lies in the box of a word, and every box touches ink on all four sides.
TEST_F(RecogniseText, BoxesHoldTheInkAndNotMuchElse) {
  const auto page = test::typeset_page("Boxes hold ink");
  const auto& samples = std::get<0>(page.picture.samples);
  const TextPage found = TextRecogniser("eng")(page.picture);
  int inked = 0, boxed = 0;
  for (int y = 0; y < samples.height(); ++y)
    for (int x = 0; x < samples.width(); ++x) {
      if (samples(x, y) > 100) continue;
      ++inked;
      bool inside = false;
      for_each_line(found, [&](const TextLine& line) {
        for (const TextWord& word : line.words)
          inside |= x >= word.box.left - 1 && x <= word.box.right && y >= word.box.top - 1 && y <= word.box.bottom;
      });
      boxed += inside;
    }
  EXPECT_GT(inked, 500);
  EXPECT_EQ(boxed, inked);
}

TEST_F(RecogniseText, NamesALanguageThatIsNotThere) {
  EXPECT_THAT(error_of([] { TextRecogniser("eng+xxx"); }), HasSubstr("language 'xxx'"));
}

}  // namespace
}  // namespace pagesweep
