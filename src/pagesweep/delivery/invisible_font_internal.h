// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>

#include "pagesweep/delivery/pdf_writer_internal.h"

namespace pagesweep {

/// The font of a text layer: it has every character and draws none. All glyphs are half as wide as the font is high,
/// and its height is shared out between ascenders and descenders as in print.
class InvisibleFont {
 public:
  static constexpr double glyph_width = 0.5;
  static constexpr double ascent = 0.77, descent = 0.23;

  /// The font's codes for a text, in hexadecimal digits as the operator Tj wants them.
  std::string codes_of(std::string_view utf8);
  /// Writes what codes_of() was asked for so far.
  void write(PdfWriter& pdf, int object) const;

 private:
  std::string to_unicode() const;
  std::map<char32_t, int> codes_;  ///< character identifiers, from 1 on
};

}  // namespace pagesweep
