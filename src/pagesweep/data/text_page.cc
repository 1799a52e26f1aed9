// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/data/text_page.h"

namespace pagesweep {

std::string plain_text(const TextPage& page) {
  std::string text;
  for (const TextBlock& block : page.blocks)
    for (const TextParagraph& paragraph : block.paragraphs) {
      if (!text.empty()) text += '\n';
      for (const TextLine& line : paragraph.lines) {
        for (const TextWord& word : line.words) text += (&word == &line.words.front() ? "" : " ") + word.text;
        text += '\n';
      }
    }
  return text;
}

}  // namespace pagesweep
