// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/tiff_reader_internal.h"

#include <fmt/format.h>
#include <tiffio.h>

#include <algorithm>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <stdexcept>
#include <vector>

namespace pagesweep {
namespace {

constexpr std::uint32_t widest_px = 200'000;
constexpr std::uint32_t most_channels = 64;
constexpr std::uint64_t most_bytes = std::uint64_t{1} << 33;
/// No codec of libtiff makes more of one byte: a header that promises more lies.
constexpr std::uint64_t most_expansion = 3000;
constexpr std::uint64_t always_plausible_bytes = 1 << 16;
constexpr std::uint64_t always_plausible_block_bytes = 1 << 24;

TiffReader::SampleFormat format_of(std::uint16_t tag) {
  switch (tag) {
    case SAMPLEFORMAT_UINT:
      return TiffReader::SampleFormat::unsigned_integer;
    case SAMPLEFORMAT_INT:
      return TiffReader::SampleFormat::signed_integer;
    case SAMPLEFORMAT_IEEEFP:
      return TiffReader::SampleFormat::floating_point;
    default:
      return TiffReader::SampleFormat::other;
  }
}

/// How a TIFF cuts its picture into pieces that are packed one by one. Strips are blocks as wide as the picture; where
/// channels are separate, each has blocks of its own.
struct Blocks {
  bool tiled = false;
  bool separate = false;
  std::uint32_t width = 0, height = 0;  ///< [px]
  std::size_t pixel_bytes = 0;          ///< in a block
};

/// A piece of the picture: its top left pixel, its size within the picture, its channel where they are separate.
struct Piece {
  std::uint32_t x = 0, y = 0, columns = 0, rows = 0;
  std::uint16_t plane = 0;
};

/// Decodes one block. Tiles are always whole; the last strip ends with the picture.
bool decode(TIFF* tiff, const Blocks& blocks, const Piece& piece, std::span<std::byte> block) {
  const std::size_t rows = blocks.tiled ? blocks.height : piece.rows;
  const auto bytes = static_cast<tmsize_t>(rows * blocks.width * blocks.pixel_bytes);
  const tmsize_t got =
      blocks.tiled
          ? TIFFReadEncodedTile(tiff, TIFFComputeTile(tiff, piece.x, piece.y, 0, piece.plane), block.data(), bytes)
          : TIFFReadEncodedStrip(tiff, TIFFComputeStrip(tiff, piece.y, piece.plane), block.data(), bytes);
  return got >= bytes;
}

/// Copies what of a block lies in the picture to where it belongs.
void place(const Blocks& blocks, const Piece& piece, std::span<const std::byte> block, std::span<std::byte> picture,
           std::size_t picture_width, std::size_t picture_pixel_bytes) {
  for (std::size_t y = 0; y < piece.rows; ++y) {
    const std::byte* from = block.data() + y * blocks.width * blocks.pixel_bytes;
    std::byte* to = picture.data() + ((piece.y + y) * picture_width + piece.x) * picture_pixel_bytes;
    if (!blocks.separate) {
      std::memcpy(to, from, piece.columns * blocks.pixel_bytes);
      continue;
    }
    to += piece.plane * blocks.pixel_bytes;
    for (std::size_t x = 0; x < piece.columns; ++x)
      std::memcpy(to + x * picture_pixel_bytes, from + x * blocks.pixel_bytes, blocks.pixel_bytes);
  }
}

}  // namespace

struct TiffReader::Handle {
  TIFF* tiff = nullptr;
  char message[200] = "";

  static int keep_message(TIFF*, void* handle, const char*, const char* format, std::va_list arguments) {
    auto& message = static_cast<Handle*>(handle)->message;
    if (message[0] == 0) std::vsnprintf(message, sizeof(message), format, arguments);
    return 1;
  }
  static int ignore(TIFF*, void*, const char*, const char*, std::va_list) { return 1; }

  explicit Handle(const std::filesystem::path& file) {
    const std::unique_ptr<TIFFOpenOptions, decltype(&TIFFOpenOptionsFree)> options(TIFFOpenOptionsAlloc(),
                                                                                   TIFFOpenOptionsFree);
    TIFFOpenOptionsSetErrorHandlerExtR(options.get(), keep_message, this);
    TIFFOpenOptionsSetWarningHandlerExtR(options.get(), ignore, this);
    TIFFOpenOptionsSetMaxSingleMemAlloc(options.get(), tmsize_t{1} << 30);
    // m: no memory map, under which a file that shrinks meanwhile would end the process
    tiff = TIFFOpenExt(file.c_str(), "rm", options.get());
  }
  ~Handle() {
    if (tiff) TIFFClose(tiff);
  }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;

  template <class T>
  T tag(std::uint32_t name, T otherwise) const {
    T value{};
    return TIFFGetFieldDefaulted(tiff, name, &value) ? value : otherwise;
  }
};

TiffReader::TiffReader(const std::filesystem::path& file) : file_(file), handle_(std::make_unique<Handle>(file)) {
  if (!handle_->tiff) throw error("it is no TIFF or cut short");
  read_layout();
  require_plausible_size();
}

TiffReader::~TiffReader() = default;

Error TiffReader::error(const std::string& problem) const {
  const std::string_view said = handle_->message;
  return cannot_read(file_, said.empty() ? problem : fmt::format("{} ({})", problem, said));
}

void TiffReader::read_layout() {
  const auto width = handle_->tag<std::uint32_t>(TIFFTAG_IMAGEWIDTH, 0);
  const auto height = handle_->tag<std::uint32_t>(TIFFTAG_IMAGELENGTH, 0);
  const auto channels = handle_->tag<std::uint16_t>(TIFFTAG_SAMPLESPERPIXEL, 1);
  if (width < 1 || height < 1 || width > widest_px || height > widest_px || channels < 1 || channels > most_channels)
    throw bad_input(file_, "",
                    fmt::format("expected a picture of at most {0} x {0} pixels and {1} channels, found {2} x "
                                "{3} and {4}",
                                widest_px, most_channels, width, height, channels));
  layout_.width = static_cast<int>(width);
  layout_.height = static_cast<int>(height);
  layout_.channels = channels;
  layout_.bits_per_sample = handle_->tag<std::uint16_t>(TIFFTAG_BITSPERSAMPLE, 1);
  layout_.format = format_of(handle_->tag<std::uint16_t>(TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_UINT));
  const auto photometric = handle_->tag<std::uint16_t>(TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
  layout_.black_is_zero = photometric != PHOTOMETRIC_MINISWHITE;
  layout_.has_palette = photometric == PHOTOMETRIC_PALETTE;
}

void TiffReader::require_plausible_size() const {
  const auto bytes = static_cast<std::uint64_t>(layout_.width) * static_cast<std::uint64_t>(layout_.height) *
                     static_cast<std::uint64_t>(layout_.channels * layout_.bits_per_sample) / 8;
  std::error_code no_size;
  const std::uint64_t file_bytes = std::filesystem::file_size(file_, no_size);
  if (bytes > most_bytes || (!no_size && bytes > always_plausible_bytes && bytes / most_expansion > file_bytes))
    throw error(fmt::format("its {} bytes cannot hold {} x {} pixels of {} channels", file_bytes, layout_.width,
                            layout_.height, layout_.channels));
}

void TiffReader::read_samples(std::span<std::byte> out) {
  if (layout_.bits_per_sample % 8 != 0)
    throw bad_input(file_, "", fmt::format("expected samples of whole bytes, found {} bit", layout_.bits_per_sample));
  const auto bytes = static_cast<std::size_t>(layout_.width) * static_cast<std::size_t>(layout_.height) *
                     static_cast<std::size_t>(layout_.channels * layout_.bits_per_sample / 8);
  if (out.size() != bytes) throw std::invalid_argument("TiffReader::read_samples: the buffer has another size");
  read_blocks(out);
}

void TiffReader::read_blocks(std::span<std::byte> out) {
  const auto width = static_cast<std::uint32_t>(layout_.width);
  const auto height = static_cast<std::uint32_t>(layout_.height);
  const auto channels = static_cast<std::uint16_t>(layout_.channels);
  const auto sample_bytes = static_cast<std::size_t>(layout_.bits_per_sample / 8);
  Blocks blocks;
  blocks.tiled = TIFFIsTiled(handle_->tiff) != 0;
  blocks.separate = handle_->tag<std::uint16_t>(TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG) == PLANARCONFIG_SEPARATE;
  blocks.width = blocks.tiled ? handle_->tag<std::uint32_t>(TIFFTAG_TILEWIDTH, 0) : width;
  blocks.height = blocks.tiled ? handle_->tag<std::uint32_t>(TIFFTAG_TILELENGTH, 0)
                               : std::min(height, handle_->tag<std::uint32_t>(TIFFTAG_ROWSPERSTRIP, height));
  blocks.pixel_bytes = blocks.separate ? sample_bytes : channels * sample_bytes;
  const std::uint64_t most_block_bytes = std::max<std::uint64_t>(always_plausible_block_bytes, 4 * out.size());
  if (blocks.width == 0 || blocks.height == 0 ||
      std::uint64_t{blocks.width} * blocks.height > most_block_bytes / blocks.pixel_bytes)
    throw error(fmt::format("its tiles of {} x {} pixels make no sense", blocks.width, blocks.height));

  std::vector<std::byte> block(std::size_t{blocks.width} * blocks.height * blocks.pixel_bytes);
  for (std::uint16_t plane = 0; plane < (blocks.separate ? channels : 1); ++plane)
    for (std::uint32_t y = 0; y < height; y += blocks.height)
      for (std::uint32_t x = 0; x < width; x += blocks.width) {
        const Piece piece{x, y, std::min(blocks.width, width - x), std::min(blocks.height, height - y), plane};
        if (!decode(handle_->tiff, blocks, piece, block))
          throw error(fmt::format("it is cut short or corrupt at row {}", y));
        place(blocks, piece, block, out, width, channels * sample_bytes);
      }
}

}  // namespace pagesweep
