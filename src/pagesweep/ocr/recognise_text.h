// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "pagesweep/data/picture.h"
#include "pagesweep/data/text_page.h"

namespace pagesweep {

/// Recognises text with the program Tesseract. Each page is a process of its own: whatever goes wrong in it is one
/// page's error, and its memory is given back.
class TextRecogniser {
 public:
  /// \param language  as Tesseract names it: "eng", or several: "eng+deu"
  /// \throws Error  (cannot_read) if Tesseract is not there; (bad_input) if it has no data for a language
  explicit TextRecogniser(std::string language);

  /// Of a page without resolution 300 dpi are assumed. May be called from several threads.
  /// \throws Error  if Tesseract fails
  TextPage operator()(const Picture& page) const;

  const std::string& language() const { return language_; }
  const std::string& version() const { return version_; }  ///< "tesseract 5.3.0"

  static bool is_installed();

 private:
  std::string language_, version_;
};

}  // namespace pagesweep
