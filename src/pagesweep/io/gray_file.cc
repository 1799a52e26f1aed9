// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <fstream>

#include "pagesweep/base/error.h"
#include "pagesweep/io/atomic_file.h"
#include "pagesweep/io/image_file.h"
#include "pagesweep/io/png_file_internal.h"
#include "pagesweep/io/tiff_reader_internal.h"

namespace pagesweep {
namespace {

constexpr std::size_t most_png_bytes = std::size_t{1} << 30;

template <class T>
Image<T> read_pixels(TiffReader& tiff) {
  Image<T> image(tiff.layout().width, tiff.layout().height);
  tiff.read_samples(std::as_writable_bytes(image.pixels()));
  return image;
}

GrayImage read_gray_tiff(const std::filesystem::path& file, std::optional<ImageSize> expected) {
  TiffReader tiff(file);
  const TiffReader::Layout& layout = tiff.layout();
  if (expected && (layout.width != expected->width || layout.height != expected->height))
    throw bad_input(file, "",
                    fmt::format("expected {} x {} pixels as in the rig, found {} x {}", expected->width,
                                expected->height, layout.width, layout.height));
  if (layout.channels != 1 || layout.has_palette)
    throw bad_input(file, "",
                    layout.has_palette ? "expected a single gray channel as recorded, found a palette"
                                       : fmt::format("expected a single gray channel as recorded, found {} "
                                                     "channels",
                                                     layout.channels));
  if (!layout.black_is_zero) throw bad_input(file, "", "expected more light to be a higher number, found white as 0");
  if (layout.format != TiffReader::SampleFormat::unsigned_integer ||
      (layout.bits_per_sample != 8 && layout.bits_per_sample != 16))
    throw bad_input(
        file, "",
        fmt::format("expected unsigned samples of 8 or 16 bit, found {} bit{}", layout.bits_per_sample,
                    layout.format == TiffReader::SampleFormat::unsigned_integer ? "" : " signed or floating point"));
  if (layout.bits_per_sample == 8) return read_pixels<std::uint8_t>(tiff);
  return read_pixels<std::uint16_t>(tiff);
}

}  // namespace

GrayImage read_gray(const std::filesystem::path& file, std::optional<ImageSize> expected) {
  char start[4] = {};
  std::ifstream(file, std::ios::binary).read(start, sizeof(start));
  const std::string_view signature(start, sizeof(start));
  const bool is_tiff = signature.starts_with("II") || signature.starts_with("MM");
  if (is_tiff) return read_gray_tiff(file, expected);
  const std::string bytes = read_bytes(file, most_png_bytes);
  if (bytes.empty()) throw cannot_read(file, "it is empty");
  if (signature != "\x89PNG") throw cannot_read(file, "expected a PNG or TIFF, found neither's first bytes");
  return decode_gray_png(bytes, file, expected);
}

}  // namespace pagesweep
