// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string_view>

#include "pagesweep/base/enum_names.h"
#include "pagesweep/base/image.h"
#include "pagesweep/data/frames.h"
#include "pagesweep/data/picture.h"

namespace pagesweep {

/// Size of a picture that is known before its file is opened.
struct ImageSize {
  int width = 0;   ///< [px]
  int height = 0;  ///< [px]
};

/// Reads a single-channel PNG or TIFF of 8 or 16 bit, as the matrix cameras' frames are; gray values as stored.
/// \param expected  another size is an error, found before any pixel is decoded
/// \throws Error  if the file cannot be read, is cut short, or is no such picture
GrayImage read_gray(const std::filesystem::path& file, std::optional<ImageSize> expected = std::nullopt);

/// Writes a single-channel PNG.
/// \param compression  zlib's level, 0 (fast) to 9 (small); noise packs hardly better above 1
/// \throws Error  if it cannot be written
void write_gray_png(const std::filesystem::path& file, ImageView<const std::uint8_t> image, int compression = 1);
void write_gray_png(const std::filesystem::path& file, ImageView<const std::uint16_t> image, int compression = 1);
void write_gray_png(const std::filesystem::path& file, const GrayImage& image, int compression = 1);

/// Reads a picture for people from PNG, TIFF, JPEG or JPEG 2000: 8 or 16 bit, gray or RGB, with its resolution, ICC
/// profile and metadata. Palettes and 1-bit pictures are expanded to 8 bit; alpha is blended over white.
/// \throws Error  if the file cannot be read, is cut short, or holds other colours (CMYK, Lab) or samples (float)
Picture read_picture(const std::filesystem::path& file);

enum class TiffCompression { none, lzw, deflate };
constexpr auto names_of(TiffCompression) { return std::array<std::string_view, 3>{"none", "lzw", "deflate"}; }

struct PictureFileOptions {
  TiffCompression tiff_compression = TiffCompression::deflate;
  int jpeg_quality = 90;
  template <class Visitor>
  void describe(Visitor&& visit) {
    visit("tiff-compression", tiff_compression, "", "how the samples of a TIFF are packed, always without loss");
    visit("jpeg-quality", jpeg_quality, "", "of a JPEG: 1 (small) to 100 (good)");
  }
};

/// Writes a picture with its resolution, ICC profile and metadata. The extension tells the format: .png, .tif, .tiff,
/// .jpg, .jpeg (8 bit only), .jp2 (JPEG 2000 without loss).
/// \throws Error  if it cannot be written or the extension is another
void write_picture(const std::filesystem::path& file, const Picture& picture, const PictureFileOptions& options = {});

}  // namespace pagesweep
