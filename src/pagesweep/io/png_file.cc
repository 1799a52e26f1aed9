// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/png_file_internal.h"

#include <fmt/format.h>
#include <png.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <new>
#include <string>
#include <vector>

#include "pagesweep/base/error.h"
#include "pagesweep/io/atomic_file.h"
#include "pagesweep/io/png_unpacking_internal.h"

namespace pagesweep {
namespace {

constexpr png_uint_32 widest_px = 200'000;
/// Deflate cannot make more than about 1032 bytes of one: a header that promises more lies.
constexpr std::size_t most_expansion = 1100;

/// libpng reports errors by longjmp out of its own calls. Every call therefore stands in a step for attempt(), which
/// owns nothing: what must be destroyed lives outside of it.
struct PngSession {
  std::string_view input;
  std::size_t consumed = 0;
  std::string output;
  char message[128] = "";

  static PngSession& of(png_structp png) { return *static_cast<PngSession*>(png_get_error_ptr(png)); }
  [[noreturn]] static void fail(png_structp png, png_const_charp message) {
    std::strncpy(of(png).message, message, sizeof(of(png).message) - 1);
    png_longjmp(png, 1);
  }
  static void ignore(png_structp, png_const_charp) {}
  static void read(png_structp png, png_bytep to, std::size_t count) {
    PngSession& session = of(png);
    if (count > session.input.size() - session.consumed) png_error(png, "the file is cut short");
    std::memcpy(to, session.input.data() + session.consumed, count);
    session.consumed += count;
  }
  static void write(png_structp png, png_bytep from, std::size_t count) {
    bool stored = true;
    try {
      of(png).output.append(reinterpret_cast<const char*>(from), count);
    } catch (const std::bad_alloc&) {
      stored = false;
    }
    if (!stored) png_error(png, "out of memory");
  }
  static void flush(png_structp) {}
};

/// Whether the step went through without an error.
template <class Step>
bool attempt(png_structp png, const Step& step) {
  if (setjmp(png_jmpbuf(png))) return false;
  step();
  return true;
}

class PngReader {
 public:
  explicit PngReader(PngSession& session)
      : png_(png_create_read_struct(PNG_LIBPNG_VER_STRING, &session, PngSession::fail, PngSession::ignore)),
        info_(png_ ? png_create_info_struct(png_) : nullptr) {
    if (!info_) throw std::bad_alloc();
    png_set_read_fn(png_, &session, PngSession::read);
    png_set_user_limits(png_, widest_px, widest_px);
  }
  ~PngReader() { png_destroy_read_struct(&png_, &info_, nullptr); }
  PngReader(const PngReader&) = delete;
  PngReader& operator=(const PngReader&) = delete;
  png_structp png() const { return png_; }
  png_infop info() const { return info_; }

 private:
  png_structp png_;
  png_infop info_;
};

class PngWriter {
 public:
  explicit PngWriter(PngSession& session)
      : png_(png_create_write_struct(PNG_LIBPNG_VER_STRING, &session, PngSession::fail, PngSession::ignore)),
        info_(png_ ? png_create_info_struct(png_) : nullptr) {
    if (!info_) throw std::bad_alloc();
    png_set_write_fn(png_, &session, PngSession::write, PngSession::flush);
  }
  ~PngWriter() { png_destroy_write_struct(&png_, &info_); }
  PngWriter(const PngWriter&) = delete;
  PngWriter& operator=(const PngWriter&) = delete;
  png_structp png() const { return png_; }
  png_infop info() const { return info_; }

 private:
  png_structp png_;
  png_infop info_;
};

std::string_view color_name(int color_type) {
  switch (color_type) {
    case PNG_COLOR_TYPE_PALETTE:
      return "a palette";
    case PNG_COLOR_TYPE_GRAY_ALPHA:
      return "gray with alpha";
    case PNG_COLOR_TYPE_RGB:
      return "RGB";
    default:
      return "RGB with alpha";
  }
}

void require_gray(const PngReader& reader, const std::filesystem::path& file, std::size_t file_bytes,
                  std::optional<ImageSize> expected) {
  const auto width = static_cast<int>(png_get_image_width(reader.png(), reader.info()));
  const auto height = static_cast<int>(png_get_image_height(reader.png(), reader.info()));
  const int color = png_get_color_type(reader.png(), reader.info());
  const int depth = png_get_bit_depth(reader.png(), reader.info());
  if (expected && (width != expected->width || height != expected->height))
    throw bad_input(file, "",
                    fmt::format("expected {} x {} pixels as in the rig, found {} x {}", expected->width,
                                expected->height, width, height));
  if (color != PNG_COLOR_TYPE_GRAY)
    throw bad_input(file, "", fmt::format("expected a single gray channel as recorded, found {}", color_name(color)));
  if (depth != 8 && depth != 16) throw bad_input(file, "", fmt::format("expected 8 or 16 bit, found {}", depth));
  const auto bytes = static_cast<std::size_t>(width) * static_cast<std::size_t>(height * (depth / 8));
  if (bytes / most_expansion > file_bytes)
    throw cannot_read(file, fmt::format("its {} bytes cannot hold {} x {} pixels", file_bytes, width, height));
}

template <class T>
Image<T> read_pixels(PngReader& reader, const PngSession& session, const std::filesystem::path& file) {
  const auto width = static_cast<int>(png_get_image_width(reader.png(), reader.info()));
  const auto height = static_cast<int>(png_get_image_height(reader.png(), reader.info()));
  if (png_get_interlace_type(reader.png(), reader.info()) == PNG_INTERLACE_NONE)
    if (auto unpacked = unpack_gray_png<T>(session.input, width, height)) return *std::move(unpacked);
  Image<T> image(width, height);
  std::vector<png_bytep> rows;
  for (int y = 0; y < image.height(); ++y) rows.push_back(reinterpret_cast<png_bytep>(image.row(y).data()));
  const bool done = attempt(reader.png(), [&] {
    if (sizeof(T) == 2 && std::endian::native == std::endian::little) png_set_swap(reader.png());
    png_read_image(reader.png(), rows.data());
    png_read_end(reader.png(), nullptr);
  });
  if (!done) throw cannot_read(file, session.message);
  return image;
}

template <class T>
void write_png(const std::filesystem::path& file, ImageView<const T> image, int compression) {
  PngSession session;
  PngWriter writer(session);
  std::vector<png_bytep> rows;
  for (int y = 0; y < image.height(); ++y)
    rows.push_back(reinterpret_cast<png_bytep>(const_cast<T*>(image.row(y).data())));
  const bool done = attempt(writer.png(), [&] {
    png_set_IHDR(writer.png(), writer.info(), static_cast<png_uint_32>(image.width()),
                 static_cast<png_uint_32>(image.height()), 8 * sizeof(T), PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_set_compression_level(writer.png(), std::clamp(compression, 0, 9));
    // Frames are noisy: trying all five filters costs most of the time and gains nothing over this one.
    png_set_filter(writer.png(), PNG_FILTER_TYPE_BASE, PNG_FILTER_SUB);
    png_write_info(writer.png(), writer.info());
    if (sizeof(T) == 2 && std::endian::native == std::endian::little) png_set_swap(writer.png());
    png_write_image(writer.png(), rows.data());
    png_write_end(writer.png(), nullptr);
  });
  if (!done) throw cannot_write(file, session.message);
  write_bytes(file, session.output);
}

}  // namespace

GrayImage decode_gray_png(std::string_view bytes, const std::filesystem::path& file,
                          std::optional<ImageSize> expected) {
  PngSession session;
  session.input = bytes;
  PngReader reader(session);
  if (!attempt(reader.png(), [&] { png_read_info(reader.png(), reader.info()); }))
    throw cannot_read(file, session.message);
  require_gray(reader, file, bytes.size(), expected);
  if (png_get_bit_depth(reader.png(), reader.info()) == 8) return read_pixels<std::uint8_t>(reader, session, file);
  return read_pixels<std::uint16_t>(reader, session, file);
}

void write_gray_png(const std::filesystem::path& file, ImageView<const std::uint8_t> image, int compression) {
  write_png(file, image, compression);
}

void write_gray_png(const std::filesystem::path& file, ImageView<const std::uint16_t> image, int compression) {
  write_png(file, image, compression);
}

void write_gray_png(const std::filesystem::path& file, const GrayImage& image, int compression) {
  std::visit([&](const auto& pixels) { write_gray_png(file, pixels.view(), compression); }, image);
}

}  // namespace pagesweep
