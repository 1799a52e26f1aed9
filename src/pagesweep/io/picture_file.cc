// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstring>
#include <fstream>
#include <vips/vips8>

#include "pagesweep/base/error.h"
#include "pagesweep/io/atomic_file.h"
#include "pagesweep/io/image_codecs.h"
#include "pagesweep/io/image_file.h"
#include "pagesweep/io/jp2_header_internal.h"
#include "pagesweep/io/jp2_writer_internal.h"
#include "pagesweep/io/tiff_writer_internal.h"

namespace pagesweep {
namespace {

using vips::VImage;

constexpr int widest_px = 200'000;
constexpr std::size_t most_samples = std::size_t{1} << 32;

/// Where libvips keeps what Picture::metadata calls so.
struct MetadataKind {
  const char* name;
  const char* vips_name;
};
constexpr MetadataKind metadata_kinds[] = {
    {"exif", VIPS_META_EXIF_NAME}, {"xmp", VIPS_META_XMP_NAME}, {"iptc", VIPS_META_IPTC_NAME}};

void drop_message(const char*, GLogLevelFlags, const char*, void*) {}

/// Starts libvips once. It would print its warnings; what matters of them also fails a call.
void start_vips() {
  static const bool started = [] {
    if (VIPS_INIT("pagesweep") != 0) return false;
    g_log_set_handler("VIPS", static_cast<GLogLevelFlags>(G_LOG_LEVEL_MASK), drop_message, nullptr);
    vips_cache_set_max(0);
    return true;
  }();
  if (!started) throw std::runtime_error("libvips cannot be started");
}

/// libvips' message, on one line.
std::string message_of(const vips::VError& error) {
  std::string message = error.what();
  vips_error_clear();
  while (!message.empty() && std::isspace(static_cast<unsigned char>(message.back()))) message.pop_back();
  std::ranges::replace(message, '\n', ';');
  return message;
}

std::vector<std::byte> blob_of(const VImage& image, const char* name) {
  if (image.get_typeof(name) == 0) return {};
  std::size_t size = 0;
  const auto* data = static_cast<const std::byte*>(image.get_blob(name, &size));
  return {data, data + size};
}

void set_blob(VImage& image, const char* name, const std::vector<std::byte>& blob) {
  if (blob.empty()) return;
  void* copy = g_malloc(blob.size());
  std::memcpy(copy, blob.data(), blob.size());
  image.set(name, [](void* data, void*) -> int { return g_free(data), 0; }, copy, blob.size());
}

/// Gray or RGB of 8 or 16 bit; alpha is blended over white, as paper is.
VImage to_gray_or_rgb(VImage image, const std::filesystem::path& file) {
  const VipsInterpretation colors = image.interpretation();
  const bool is_gray = colors == VIPS_INTERPRETATION_B_W || colors == VIPS_INTERPRETATION_GREY16;
  const bool is_rgb =
      colors == VIPS_INTERPRETATION_sRGB || colors == VIPS_INTERPRETATION_RGB || colors == VIPS_INTERPRETATION_RGB16;
  const VipsBandFormat format = image.format();
  const int bands = image.bands();
  if (format != VIPS_FORMAT_UCHAR && format != VIPS_FORMAT_USHORT)
    throw bad_input(file, "",
                    fmt::format("expected unsigned samples of 8 or 16 bit, found {}",
                                vips_enum_nick(VIPS_TYPE_BAND_FORMAT, format)));
  const int color_bands = is_gray ? 1 : 3;
  if (!(is_gray || is_rgb) || bands < color_bands || bands > color_bands + 1)
    throw bad_input(file, "",
                    fmt::format("expected gray or RGB, found {} with {} channels: convert it first",
                                vips_enum_nick(VIPS_TYPE_INTERPRETATION, colors), bands));
  if (bands == color_bands) return image;
  const double white = format == VIPS_FORMAT_UCHAR ? 255 : 65535;
  return image
      .flatten(VImage::option()
                   ->set("background", std::vector<double>(static_cast<std::size_t>(color_bands), white))
                   ->set("max_alpha", white))
      .cast(format);
}

template <class T>
Image<T> copy_samples(const VImage& image) {
  Image<T> samples(image.width() * image.bands(), image.height());
  const VImage target = VImage::new_from_memory(samples.data(), samples.size() * sizeof(T), image.width(),
                                                image.height(), image.bands(), image.format());
  image.write(target);
  return samples;
}

/// Opened by what its first bytes say. libvips could guess, but it knows also formats that can name other files or
/// take programs to draw, and options in file names.
VImage open_image(const std::filesystem::path& file) {
  char start[12] = {};
  std::ifstream(file, std::ios::binary).read(start, sizeof(start));
  const std::string_view signature(start, sizeof(start));
  auto* const options = VImage::option()->set("access", VIPS_ACCESS_SEQUENTIAL)->set("fail_on", VIPS_FAIL_ON_TRUNCATED);
  const char* name = file.c_str();
  if (signature.starts_with("\x89PNG")) return VImage::pngload(name, options);
  if (signature.starts_with("\xff\xd8\xff")) return VImage::jpegload(name, options);
  if (signature.starts_with("II") || signature.starts_with("MM")) return VImage::tiffload(name, options);
  if (signature.substr(4).starts_with("jP  ") || signature.starts_with("\xff\x4f\xff\x51"))
    return VImage::jp2kload(name, options);
  delete options;
  throw cannot_read(file, "expected a PNG, TIFF, JPEG or JPEG 2000, found none of their first bytes");
}

/// [px/mm] 0: unknown, for which libvips has defaults.
double resolution_of(const VImage& image) {
  const double default_of_png = 2.834;  // 72 dpi, but not as a PNG would say it
  const bool is_png = std::string_view(image.get_string("vips-loader")) == "pngload";
  const bool is_unknown = !(image.xres() > 0) || image.xres() == 1 || (is_png && image.xres() == default_of_png);
  return is_unknown ? 0 : image.xres();
}

/// What libvips does not look for in the header of a JPEG 2000 file.
void add_jp2_header(Picture& picture, const std::filesystem::path& file) {
  std::string start(std::size_t{1} << 22, '\0');
  std::ifstream stream(file, std::ios::binary);
  stream.read(start.data(), static_cast<std::streamsize>(start.size()));
  const auto header = read_jp2_header(std::string_view(start).substr(0, static_cast<std::size_t>(stream.gcount())));
  picture.pixels_per_mm = header.pixels_per_mm;
  picture.icc_profile = header.icc_profile;
  if (!header.xmp.empty()) picture.metadata["xmp"] = header.xmp;
}

Picture read_with_vips(const std::filesystem::path& file) {
  VImage image = open_image(file);
  const auto samples = static_cast<std::size_t>(image.width()) * static_cast<std::size_t>(image.height()) *
                       static_cast<std::size_t>(image.bands());
  if (image.width() > widest_px || image.height() > widest_px || samples > most_samples)
    throw bad_input(
        file, "",
        fmt::format("expected at most {0} x {0} pixels, found {1} x {2}", widest_px, image.width(), image.height()));
  Picture picture;
  picture.icc_profile = blob_of(image, VIPS_META_ICC_NAME);
  for (const auto& kind : metadata_kinds)
    if (auto blob = blob_of(image, kind.vips_name); !blob.empty()) picture.metadata[kind.name] = std::move(blob);
  picture.pixels_per_mm = resolution_of(image);
  if (std::string_view(image.get_string("vips-loader")) == "jp2kload") add_jp2_header(picture, file);
  if (std::string_view(image.get_string("vips-loader")) == "tiffload" && !picture.metadata.contains("exif"))
    if (auto exif = read_tiff_tags(file); !exif.empty()) picture.metadata["exif"] = std::move(exif);
  image = to_gray_or_rgb(image, file);
  picture.channels = image.bands();
  if (image.format() == VIPS_FORMAT_UCHAR)
    picture.samples = copy_samples<std::uint8_t>(image);
  else
    picture.samples = copy_samples<std::uint16_t>(image);
  return picture;
}

VImage to_vips(const Picture& picture) {
  const bool is_8_bit = picture.bit_depth() == 8;
  VImage image = std::visit(
      [&](const auto& samples) {
        return VImage::new_from_memory(const_cast<void*>(static_cast<const void*>(samples.data())),
                                       samples.size() * static_cast<std::size_t>(picture.bit_depth() / 8),
                                       picture.width(), picture.height(), picture.channels,
                                       is_8_bit ? VIPS_FORMAT_UCHAR : VIPS_FORMAT_USHORT);
      },
      picture.samples);
  const VipsInterpretation gray = is_8_bit ? VIPS_INTERPRETATION_B_W : VIPS_INTERPRETATION_GREY16;
  const VipsInterpretation rgb = is_8_bit ? VIPS_INTERPRETATION_sRGB : VIPS_INTERPRETATION_RGB16;
  auto* const options = VImage::option()->set("interpretation", picture.channels == 1 ? gray : rgb);
  if (picture.pixels_per_mm > 0) options->set("xres", picture.pixels_per_mm)->set("yres", picture.pixels_per_mm);
  image = image.copy(options);
  if (picture.pixels_per_mm > 0) image.set(VIPS_META_RESOLUTION_UNIT, "in");
  set_blob(image, VIPS_META_ICC_NAME, picture.icc_profile);
  for (const auto& [name, blob] : picture.metadata)
    for (const auto& kind : metadata_kinds)
      if (name == kind.name) set_blob(image, kind.vips_name, blob);
  image.set(VIPS_META_ORIENTATION, 1);  // last: the EXIF blob may say otherwise of the scan
  return image;
}

std::string lower_case_extension(const std::filesystem::path& file) {
  std::string extension = file.extension().string();
  std::ranges::transform(extension, extension.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension;
}

std::span<const std::byte> xmp_of(const Picture& picture) {
  const auto found = picture.metadata.find("xmp");
  return found == picture.metadata.end() ? std::span<const std::byte>() : found->second;
}

vips::VOption* jpeg_options(int quality) {
  return VImage::option()->set("Q", std::clamp(quality, 1, 100))->set("optimize_coding", true);
}

void save(const VImage& image, const std::filesystem::path& file, const std::string& extension,
          const PictureFileOptions& options) {
  const char* name = file.c_str();
  if (extension == ".png") {
    // A third of the time of level 6, zlib's own choice, for files that are a twelfth larger.
    image.pngsave(name, VImage::option()->set("compression", 4));
  } else {
    image.jpegsave(name, jpeg_options(options.jpeg_quality));
  }
}

}  // namespace

Picture read_picture(const std::filesystem::path& file) {
  start_vips();
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) throw cannot_read(file, "there is no such file");
  try {
    return read_with_vips(file);
  } catch (const vips::VError& e) {
    throw cannot_read(file, message_of(e));
  }
}

void write_picture(const std::filesystem::path& file, const Picture& picture, const PictureFileOptions& options) {
  start_vips();
  const std::string extension = lower_case_extension(file);
  constexpr std::array<std::string_view, 6> known = {".png", ".tif", ".tiff", ".jpg", ".jpeg", ".jp2"};
  if (std::ranges::find(known, extension) == known.end())
    throw cannot_write(file, "expected a name that ends in .png, .tif, .tiff, .jpg, .jpeg or .jp2");
  if (extension.starts_with(".jpe") || extension == ".jpg")
    if (picture.bit_depth() == 16)
      throw cannot_write(file, "a JPEG holds 8 bit and the picture has 16: write PNG, TIFF or JPEG 2000");
  if (picture.width() == 0 || picture.height() == 0) throw std::invalid_argument("write_picture: the picture is empty");
  try {
    if (extension == ".jp2") {
      write_bytes(file,
                  complete_jp2_header(pack_jp2(picture), picture.pixels_per_mm, picture.icc_profile, xmp_of(picture)));
      return;
    }
    AtomicFile output(file);
    if (extension.starts_with(".tif"))
      write_tiff(output.temporary(), picture, options.tiff_compression);
    else
      save(to_vips(picture), output.temporary(), extension, options);
    output.commit();
  } catch (const vips::VError& e) {
    throw cannot_write(file, message_of(e));
  } catch (const Error&) {
    throw;
  } catch (const std::runtime_error& e) {  // of the packers, which do not know the file
    throw cannot_write(file, e.what());
  }
}

Picture with_8_bit(const Picture& picture) {
  const auto* fine = std::get_if<Image<std::uint16_t>>(&picture.samples);
  if (!fine) return picture;
  Picture result{Image<std::uint8_t>(fine->width(), fine->height()), picture.channels, picture.pixels_per_mm,
                 picture.icc_profile, picture.metadata};
  std::ranges::transform(fine->pixels(), std::get<0>(result.samples).data(),
                         [](std::uint16_t value) { return static_cast<std::uint8_t>((value + 128) / 257); });
  return result;
}

std::string encode_jpeg(const Picture& picture, int quality) {
  start_vips();
  const Picture bare{with_8_bit(picture).samples, picture.channels, picture.pixels_per_mm, {}, {}};
  VipsBlob* const blob = to_vips(bare).jpegsave_buffer(jpeg_options(quality)->set("strip", true));
  std::size_t size = 0;
  const auto* data = static_cast<const char*>(vips_blob_get(blob, &size));
  std::string bytes(data, size);
  vips_area_unref(VIPS_AREA(blob));
  return bytes;
}

std::string encode_jp2(const Picture& picture) {
  return complete_jp2_header(pack_jp2(picture), picture.pixels_per_mm, picture.icc_profile, {});
}

}  // namespace pagesweep
