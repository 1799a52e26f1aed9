// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/delivery/pdf_document.h"

#include <fmt/format.h>

#include <cmath>
#include <map>
#include <stdexcept>

#include "pagesweep/delivery/checksum.h"
#include "pagesweep/delivery/invisible_font_internal.h"
#include "pagesweep/delivery/pdf_writer_internal.h"
#include "pagesweep/io/color_profile.h"
#include "pagesweep/io/image_codecs.h"
#include "pagesweep/io/xmp.h"

namespace pagesweep {
namespace {

constexpr double points_per_mm = 72 / 25.4;
constexpr double usual_pixels_per_mm = 300 / 25.4;

std::string_view text_of(const std::vector<std::byte>& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// A number as PDF wants it: no exponent, no more digits than matter.
std::string number(double value) {
  std::string digits = fmt::format("{:.4f}", value);
  digits.erase(digits.find_last_not_of('0') + 1);
  if (digits.ends_with('.')) digits.pop_back();
  return digits == "-0" ? "0" : digits;
}

/// One bit pattern of 16 bytes from hexadecimal digits.
std::string bytes_of_digits(const std::string& digits) {
  std::string bytes;
  for (std::size_t i = 0; i < 32; i += 2) bytes += static_cast<char>(std::stoi(digits.substr(i, 2), nullptr, 16));
  return bytes;
}

/// Operators that place the words of a line. Each word is as wide as its box; the blank after it belongs to it.
std::string place_line(const TextLine& line, double points_per_px, double page_height_px, InvisibleFont& font) {
  const double size_px = line.size_px > 0 ? line.size_px : std::max(1.0, line.box.height());
  const double angle = -std::atan(line.baseline_slope);  // y counts upwards
  std::string text = fmt::format("/F1 {} Tf\n", number(size_px * points_per_px));
  for (const TextWord& word : line.words) {
    const bool is_last = &word == &line.words.back();
    const auto letters = static_cast<double>(decode_utf8(word.text).size());
    const double natural_px = letters * InvisibleFont::glyph_width * size_px * std::cos(angle);
    text +=
        fmt::format("{} Tz {} {} {} {} {} {} Tm <{}> Tj\n", number(100 * std::max(1.0, word.box.width()) / natural_px),
                    number(std::cos(angle)), number(std::sin(angle)), number(-std::sin(angle)), number(std::cos(angle)),
                    number(word.box.left * points_per_px),
                    number((page_height_px - line.baseline_at(word.box.left)) * points_per_px),
                    font.codes_of(word.text + (is_last ? "" : " ")));
  }
  return text;
}

}  // namespace

PdfImage make_pdf_image(const Picture& picture, PdfImagePacking packing, int jpeg_quality) {
  Picture page = packing == PdfImagePacking::jpeg ? with_8_bit(picture) : picture;
  complete_profile(page);
  PdfImage image{packing, {}, page.width(), page.height(), page.channels, page.bit_depth(), page.pixels_per_mm, {}};
  image.bytes = packing == PdfImagePacking::jpeg ? encode_jpeg(page, jpeg_quality) : encode_jp2(page);
  if (!(image.pixels_per_mm > 0)) image.pixels_per_mm = usual_pixels_per_mm;
  image.icc_profile = std::move(page.icc_profile);
  return image;
}

class PdfDocument::Body {
 public:
  Body(const std::filesystem::path& file, PdfMetadata metadata)
      : pdf_(file), metadata_(std::move(metadata)), catalog_(pdf_.reserve()), pages_(pdf_.reserve()) {}

  void add(const PdfImage& image, const TextPage* text) {
    const double points_per_px = points_per_mm / image.pixels_per_mm;
    const std::string width = number(image.width_px * points_per_px), height = number(image.height_px * points_per_px);
    const int page = pdf_.reserve(), content = pdf_.reserve(), picture = write_image(image);
    std::string operators = fmt::format("q {} 0 0 {} 0 0 cm /Im1 Do Q\n", width, height);
    const bool has_text = text && !text->blocks.empty();
    if (has_text) operators += place_text(*text, points_per_px, image.height_px);
    pdf_.write_packed_stream(content, "", operators);
    content_.add(operators);
    pdf_.write(page,
               fmt::format("<< /Type /Page /Parent {} /MediaBox [0 0 {} {}] /Contents {} /Resources << /XObject << "
                           "/Im1 {} >> {} >> >>",
                           pdf_reference(pages_), width, height, pdf_reference(content), pdf_reference(picture),
                           has_text ? "/Font << /F1 " + pdf_reference(font_object_) + " >>" : ""));
    kids_ += pdf_reference(page) + "\n";
    ++count_;
  }

  void finish() {
    if (count_ == 0) throw std::invalid_argument("PdfDocument: a PDF needs a page");
    const std::string id = content_.digits();
    const int metadata = pdf_.reserve(), intent_profile = profile(make_srgb_profile(), 3);
    if (font_object_ > 0) font_.write(pdf_, font_object_);
    pdf_.write(pages_, fmt::format("<< /Type /Pages /Count {} /Kids [\n{}] >>", count_, kids_));
    pdf_.write_stream(metadata, "/Type /Metadata /Subtype /XML", make_metadata(id));
    pdf_.write(catalog_, fmt::format("<< /Type /Catalog /Pages {} /Metadata {} /OutputIntents [<< /Type /OutputIntent "
                                     "/S /GTS_PDFA1 /OutputConditionIdentifier (sRGB) /Info (sRGB IEC61966-2.1) "
                                     "/DestOutputProfile {} >>] /PageLabels << /Nums [0 << /S /D /St {} >>] >> "
                                     "/ViewerPreferences << /DisplayDocTitle true >> >>",
                                     pdf_reference(pages_), pdf_reference(metadata), pdf_reference(intent_profile),
                                     std::max(1, metadata_.first_page)));
    pdf_.finish(catalog_, bytes_of_digits(id));
  }

 private:
  int write_image(const PdfImage& image) {
    const int object = pdf_.reserve();
    const bool is_jpeg = image.packing == PdfImagePacking::jpeg;
    pdf_.write_stream(
        object,
        fmt::format("/Type /XObject /Subtype /Image /Width {} /Height {} /BitsPerComponent {} /ColorSpace "
                    "[/ICCBased {}] /Filter /{}",
                    image.width_px, image.height_px, image.bit_depth,
                    pdf_reference(profile(image.icc_profile, image.channels)), is_jpeg ? "DCTDecode" : "JPXDecode"),
        image.bytes);
    content_.add(image.bytes);
    return object;
  }

  /// The object of a colour profile, which all pages share that have the same.
  int profile(const std::vector<std::byte>& icc, int channels) {
    int& object = profiles_[std::string(text_of(icc))];
    if (object == 0) {
      object = pdf_.reserve();
      pdf_.write_packed_stream(object, fmt::format("/N {}", channels), text_of(icc));
    }
    return object;
  }

  std::string place_text(const TextPage& text, double points_per_px, double page_height_px) {
    if (font_object_ == 0) font_object_ = pdf_.reserve();
    std::string operators = "BT 3 Tr\n";
    for_each_line(text,
                  [&](const TextLine& line) { operators += place_line(line, points_per_px, page_height_px, font_); });
    return operators + "ET\n";
  }

  std::string make_metadata(const std::string& id) const {
    return make_xmp({{"pdfaid:part", "2"},
                     {"pdfaid:conformance", "B"},
                     {"dc:title", metadata_.title, XmpKind::alternative},
                     {"dc:format", "application/pdf"},
                     {"xmp:CreatorTool", metadata_.program},
                     {"xmp:CreateDate", metadata_.date},
                     {"xmp:ModifyDate", metadata_.date},
                     {"xmp:MetadataDate", metadata_.date},
                     {"pdf:Producer", metadata_.program},
                     {"xmpMM:DocumentID", "uuid:" + id.substr(0, 32)},
                     {"xmpMM:InstanceID", "uuid:" + id.substr(32)}});
  }

  PdfWriter pdf_;
  PdfMetadata metadata_;
  int catalog_, pages_, font_object_ = 0, count_ = 0;
  std::string kids_;
  InvisibleFont font_;
  std::map<std::string, int> profiles_;
  Sha256 content_;
};

PdfDocument::PdfDocument(const std::filesystem::path& file, PdfMetadata metadata)
    : body_(std::make_unique<Body>(file, std::move(metadata))) {}
PdfDocument::~PdfDocument() = default;
void PdfDocument::add(const PdfImage& image, const TextPage* text) { body_->add(image, text); }
void PdfDocument::finish() { body_->finish(); }

}  // namespace pagesweep
