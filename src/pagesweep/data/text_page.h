// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

namespace pagesweep {

/// Upright box on a page [px]. Edges are counted as in hOCR: `left` and `top` belong to the box, `right` and `bottom`
/// no longer do, so that the whole page is 0, 0, width, height.
struct TextBox {
  double left = 0, top = 0, right = 0, bottom = 0;
  double width() const { return right - left; }
  double height() const { return bottom - top; }
};

struct TextWord {
  std::string text;  ///< UTF-8, not empty, no blanks
  TextBox box;
  double confidence = 0;  ///< 0 to 1, as the recognition itself claims
};

struct TextLine {
  TextBox box;
  double baseline_slope = 0;      ///< downwards over rightwards
  double baseline_offset_px = 0;  ///< of the baseline below the box's bottom, at its left edge; above: negative
  double size_px = 0;             ///< from the lowest descender to the highest ascender of the script; 0: not known
  std::vector<TextWord> words;

  double baseline_at(double x) const { return box.bottom + baseline_offset_px + baseline_slope * (x - box.left); }
};

struct TextParagraph {
  TextBox box;
  std::string language;  ///< as Tesseract names it: "eng"; empty: not known
  std::vector<TextLine> lines;
};

struct TextBlock {
  TextBox box;
  std::vector<TextParagraph> paragraphs;
};

/// The text of one page and where it stands, in reading order.
struct TextPage {
  int width_px = 0, height_px = 0;
  double pixels_per_mm = 0;  ///< 0: not known
  std::vector<TextBlock> blocks;
};

/// Calls visit(line) for each line in reading order.
template <class Visit>
void for_each_line(const TextPage& page, Visit&& visit) {
  for (const TextBlock& block : page.blocks)
    for (const TextParagraph& paragraph : block.paragraphs)
      for (const TextLine& line : paragraph.lines) visit(line);
}

/// Words with blanks between them, lines with line breaks, paragraphs with empty lines.
std::string plain_text(const TextPage& page);

}  // namespace pagesweep
