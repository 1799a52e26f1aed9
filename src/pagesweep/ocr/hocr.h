// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "pagesweep/data/text_page.h"

namespace pagesweep {

/// What an hOCR file says beside the text.
struct HocrHeader {
  std::string title;   ///< of the document
  std::string image;   ///< name of the page's picture
  std::string system;  ///< what recognised the text: "tesseract 5.3.0"
};

/// One page as hOCR 1.2 (XHTML): ocr_page, ocr_carea, ocr_par, ocr_line and ocrx_word with their boxes, baselines and
/// confidences, in pixels of the page. Boxes are rounded outwards to whole pixels, as the format wants.
std::string format_hocr(const TextPage& page, const HocrHeader& header);

/// Reads the first page of an hOCR text: what format_hocr() or Tesseract wrote.
/// \param file  serves the messages
/// \throws Error  if it is no well-formed XHTML, has no ocr_page, or a box in it makes no sense
TextPage parse_hocr(std::string_view text, const std::filesystem::path& file);

}  // namespace pagesweep
