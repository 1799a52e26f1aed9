// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "pagesweep/base/enum_names.h"
#include "pagesweep/data/picture.h"
#include "pagesweep/data/text_page.h"

namespace pagesweep {

/// How the pages' pictures are packed in a PDF.
enum class PdfImagePacking {
  jpeg,  ///< with loss, for reading: JPEG
  jp2,   ///< without loss: JPEG 2000
};
constexpr auto names_of(PdfImagePacking) { return std::array<std::string_view, 2>{"jpeg", "jp2"}; }

/// A page's picture, ready to be embedded.
struct PdfImage {
  PdfImagePacking packing = PdfImagePacking::jpeg;
  std::string bytes;  ///< a JPEG or JPEG 2000 file
  int width_px = 0, height_px = 0, channels = 1, bit_depth = 8;
  double pixels_per_mm = 0;
  std::vector<std::byte> icc_profile;
};

/// Packs a picture. Without a profile that fits it counts as sRGB, without a resolution as 300 dpi.
PdfImage make_pdf_image(const Picture& picture, PdfImagePacking packing, int jpeg_quality);

struct PdfMetadata {
  std::string title;
  std::string program;  ///< "pagesweep 0.1.0"
  std::string date;     ///< ISO 8601; empty: not told
  int first_page = 1;   ///< what viewers call the first page
};

/// Writes a PDF/A-2b file (ISO 19005-2) page by page, of which it keeps none: pictures in their own colours (ICC), sRGB
/// as the output intent, XMP metadata, and where text is known an invisible layer with each word where it stands, in an
/// embedded font. Nothing is encrypted, nothing refers to anything outside. The same pages give the same file.
class PdfDocument {
 public:
  /// \param file  is written at once: give a temporary one
  /// \throws Error  if it cannot be written
  PdfDocument(const std::filesystem::path& file, PdfMetadata metadata);
  ~PdfDocument();
  PdfDocument(const PdfDocument&) = delete;
  PdfDocument& operator=(const PdfDocument&) = delete;

  /// \param text  in pixels of the picture; may be absent
  void add(const PdfImage& image, const TextPage* text);
  /// To be called after the last page.
  /// \throws Error                  if the file cannot be written
  /// \throws std::invalid_argument  if there is no page
  void finish();

 private:
  class Body;
  std::unique_ptr<Body> body_;
};

}  // namespace pagesweep
