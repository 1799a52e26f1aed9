// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/tiff_writer_internal.h"

#include <tiffio.h>

#include <algorithm>
#include <array>
#include <cstdarg>
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <string>

#include "pagesweep/io/capture_tags.h"

namespace pagesweep {
namespace {

constexpr std::size_t strip_bytes = 1 << 16;
constexpr double mm_per_inch = 25.4;

struct Close {
  void operator()(TIFF* tiff) const { TIFFClose(tiff); }
};
using Tiff = std::unique_ptr<TIFF, Close>;

struct Field {
  ttag_t tag;
  std::string CaptureTags::* member;
};
constexpr std::array<Field, 7> fields = {{{TIFFTAG_IMAGEDESCRIPTION, &CaptureTags::description},
                                          {TIFFTAG_MAKE, &CaptureTags::make},
                                          {TIFFTAG_MODEL, &CaptureTags::model},
                                          {TIFFTAG_SOFTWARE, &CaptureTags::software},
                                          {TIFFTAG_DATETIME, &CaptureTags::date_time},
                                          {TIFFTAG_ARTIST, &CaptureTags::artist},
                                          {TIFFTAG_COPYRIGHT, &CaptureTags::copyright}}};

/// libtiff would print.
int keep_message(TIFF*, void* message, const char*, const char* format, va_list arguments) {
  char text[256];
  std::vsnprintf(text, sizeof(text), format, arguments);
  *static_cast<std::string*>(message) = text;
  return 1;
}

/// \param message  keeps what libtiff says as long as the file is open
Tiff open(const std::filesystem::path& file, const char* mode, std::string& message) {
  const std::unique_ptr<TIFFOpenOptions, void (*)(TIFFOpenOptions*)> options(TIFFOpenOptionsAlloc(),
                                                                             TIFFOpenOptionsFree);
  TIFFOpenOptionsSetErrorHandlerExtR(options.get(), keep_message, &message);
  TIFFOpenOptionsSetWarningHandlerExtR(options.get(), keep_message, &message);
  return Tiff(TIFFOpenExt(file.c_str(), mode, options.get()));
}

std::uint16_t code_of(TiffCompression compression) {
  constexpr std::array<std::uint16_t, 3> codes = {COMPRESSION_NONE, COMPRESSION_LZW, COMPRESSION_ADOBE_DEFLATE};
  return codes[static_cast<std::size_t>(compression)];
}

void set_layout(TIFF* tiff, const Picture& picture, TiffCompression compression) {
  const auto width = static_cast<std::uint32_t>(picture.width());
  TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, width);
  TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, static_cast<std::uint32_t>(picture.height()));
  TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, picture.bit_depth());
  TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, picture.channels);
  TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, picture.channels == 1 ? PHOTOMETRIC_MINISBLACK : PHOTOMETRIC_RGB);
  TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
  TIFFSetField(tiff, TIFFTAG_ORIENTATION, ORIENTATION_TOPLEFT);
  TIFFSetField(tiff, TIFFTAG_COMPRESSION, code_of(compression));
  if (compression != TiffCompression::none) TIFFSetField(tiff, TIFFTAG_PREDICTOR, PREDICTOR_HORIZONTAL);
  const std::size_t row_bytes =
      std::size_t{width} * static_cast<std::size_t>(picture.channels * picture.bit_depth() / 8);
  TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP,
               static_cast<std::uint32_t>(std::max<std::size_t>(1, strip_bytes / row_bytes)));
  if (!(picture.pixels_per_mm > 0)) return;
  TIFFSetField(tiff, TIFFTAG_RESOLUTIONUNIT, RESUNIT_INCH);
  TIFFSetField(tiff, TIFFTAG_XRESOLUTION, picture.pixels_per_mm * mm_per_inch);
  TIFFSetField(tiff, TIFFTAG_YRESOLUTION, picture.pixels_per_mm * mm_per_inch);
}

void set_metadata(TIFF* tiff, const Picture& picture) {
  const auto set_blob = [&](ttag_t tag, const std::vector<std::byte>& blob, std::size_t unit) {
    if (!blob.empty()) TIFFSetField(tiff, tag, static_cast<std::uint32_t>(blob.size() / unit), blob.data());
  };
  set_blob(TIFFTAG_ICCPROFILE, picture.icc_profile, 1);
  for (const auto& [name, blob] : picture.metadata) {
    if (name == "xmp") set_blob(TIFFTAG_XMLPACKET, blob, 1);
    if (name == "iptc") {  // libtiff counts it in words of 4 bytes
      std::vector<std::byte> padded = blob;
      padded.resize((blob.size() + 3) / 4 * 4);
      set_blob(TIFFTAG_RICHTIFFIPTC, padded, 4);
    }
    if (name != "exif") continue;
    const CaptureTags tags = read_exif(blob);
    for (const Field& field : fields)
      if (!(tags.*field.member).empty()) TIFFSetField(tiff, field.tag, (tags.*field.member).c_str());
  }
}

bool write_rows(TIFF* tiff, const Picture& picture) {
  return std::visit(
      [&](auto samples) {  // a copy: the predictor works in place
        for (int y = 0; y < samples.height(); ++y)
          if (TIFFWriteScanline(tiff, samples.row(y).data(), static_cast<std::uint32_t>(y)) < 0) return false;
        return true;
      },
      picture.samples);
}

}  // namespace

void write_tiff(const std::filesystem::path& file, const Picture& picture, TiffCompression compression) {
  constexpr std::uint64_t most_classic_bytes = 0xF0000000;
  const auto bytes = static_cast<std::uint64_t>(picture.width()) * static_cast<std::uint64_t>(picture.height()) *
                     static_cast<std::uint64_t>(picture.channels * picture.bit_depth() / 8);
  std::string message = "libtiff does not say why";
  const Tiff tiff = open(file, bytes < most_classic_bytes ? "wl" : "wl8", message);
  if (!tiff) throw std::runtime_error(message);
  set_layout(tiff.get(), picture, compression);
  set_metadata(tiff.get(), picture);
  if (!write_rows(tiff.get(), picture) || !TIFFFlush(tiff.get())) throw std::runtime_error(message);
}

std::vector<std::byte> read_tiff_tags(const std::filesystem::path& file) {
  std::string message;
  const Tiff tiff = open(file, "r", message);
  CaptureTags tags;
  for (const Field& field : fields) {
    const char* text = nullptr;
    if (tiff && TIFFGetField(tiff.get(), field.tag, &text) && text) tags.*field.member = text;
  }
  return tags.empty() ? std::vector<std::byte>{} : make_exif(tags);
}

}  // namespace pagesweep
