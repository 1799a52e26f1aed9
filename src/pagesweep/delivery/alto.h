// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "pagesweep/data/text_page.h"

namespace pagesweep {

/// What an ALTO file says beside the text.
struct AltoHeader {
  std::string image;    ///< name of the page's picture
  std::string program;  ///< "pagesweep 0.1.0"
  std::string ocr;      ///< "tesseract 5.3.0"
  std::string date;     ///< of the processing, ISO 8601; empty: not told
};

/// One page as ALTO 4.2: TextBlock (a paragraph), TextLine, String and SP with their places in pixels of the page, the
/// baseline as points, word confidences, and the languages of paragraphs.
std::string format_alto(const TextPage& page, const AltoHeader& header);

}  // namespace pagesweep
