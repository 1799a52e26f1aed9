// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/float_tiff.h"

#include <fmt/format.h>
#include <tiffio.h>

#include <algorithm>
#include <cstdarg>
#include <cstdio>
#include <memory>
#include <stdexcept>

#include "pagesweep/base/error.h"
#include "pagesweep/io/atomic_file.h"
#include "pagesweep/io/tiff_reader_internal.h"

namespace pagesweep {
namespace {

constexpr int rows_per_strip = 64;

template <class T>
std::vector<Image<float>> read_channels(TiffReader& tiff) {
  const auto [width, height, channels] = std::tuple(tiff.layout().width, tiff.layout().height, tiff.layout().channels);
  std::vector<T> samples(static_cast<std::size_t>(width) * static_cast<std::size_t>(height) *
                         static_cast<std::size_t>(channels));
  tiff.read_samples(std::as_writable_bytes(std::span(samples)));
  std::vector<Image<float>> images;
  for (int c = 0; c < channels; ++c) {
    Image<float>& image = images.emplace_back(width, height);
    const T* from = samples.data() + c;
    for (float& value : image.pixels()) {
      value = static_cast<float>(*from);
      from += channels;
    }
  }
  return images;
}

struct TiffWriter {
  TIFF* tiff = nullptr;
  char message[200] = "";

  static int keep_message(TIFF*, void* writer, const char*, const char* format, std::va_list arguments) {
    auto& message = static_cast<TiffWriter*>(writer)->message;
    if (message[0] == 0) std::vsnprintf(message, sizeof(message), format, arguments);
    return 1;
  }
  explicit TiffWriter(const std::filesystem::path& file) {
    const std::unique_ptr<TIFFOpenOptions, decltype(&TIFFOpenOptionsFree)> options(TIFFOpenOptionsAlloc(),
                                                                                   TIFFOpenOptionsFree);
    TIFFOpenOptionsSetErrorHandlerExtR(options.get(), keep_message, this);
    TIFFOpenOptionsSetWarningHandlerExtR(options.get(), keep_message, this);
    tiff = TIFFOpenExt(file.c_str(), "w", options.get());
  }
  ~TiffWriter() {
    if (tiff) TIFFClose(tiff);
  }
  TiffWriter(const TiffWriter&) = delete;
  TiffWriter& operator=(const TiffWriter&) = delete;
};

void set_tags(TIFF* tiff, int width, int height, int channels) {
  TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, static_cast<std::uint32_t>(width));
  TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, static_cast<std::uint32_t>(height));
  TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, channels);
  TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, 32);
  TIFFSetField(tiff, TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_IEEEFP);
  TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
  TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, channels == 3 ? PHOTOMETRIC_RGB : PHOTOMETRIC_MINISBLACK);
  TIFFSetField(tiff, TIFFTAG_ORIENTATION, ORIENTATION_TOPLEFT);
  TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, static_cast<std::uint32_t>(rows_per_strip));
  // Deflate needs the floating point predictor to gain anything, and few programs know that one.
  TIFFSetField(tiff, TIFFTAG_COMPRESSION, COMPRESSION_NONE);
  const int color_channels = channels == 3 ? 3 : 1;
  if (channels > color_channels) {
    const std::vector<std::uint16_t> extra(static_cast<std::size_t>(channels - color_channels),
                                           EXTRASAMPLE_UNSPECIFIED);
    TIFFSetField(tiff, TIFFTAG_EXTRASAMPLES, static_cast<std::uint16_t>(extra.size()), extra.data());
  }
}

bool write_strips(TIFF* tiff, std::span<const ImageView<const float>> channels) {
  const int width = channels[0].width();
  const int height = channels[0].height();
  std::vector<float> strip;
  for (int y0 = 0; y0 < height; y0 += rows_per_strip) {
    const int rows = std::min(rows_per_strip, height - y0);
    strip.resize(static_cast<std::size_t>(rows) * static_cast<std::size_t>(width) * channels.size());
    for (std::size_t c = 0; c < channels.size(); ++c) {
      float* to = strip.data() + c;
      for (int y = y0; y < y0 + rows; ++y)
        for (const float value : channels[c].row(y)) {
          *to = value;
          to += channels.size();
        }
    }
    const auto bytes = static_cast<tmsize_t>(strip.size() * sizeof(float));
    if (TIFFWriteEncodedStrip(tiff, static_cast<std::uint32_t>(y0 / rows_per_strip), strip.data(), bytes) != bytes)
      return false;
  }
  return TIFFWriteDirectory(tiff) != 0;
}

}  // namespace

std::vector<Image<float>> read_float_tiff(const std::filesystem::path& file) {
  TiffReader tiff(file);
  const auto& layout = tiff.layout();
  const bool is_float = layout.format == TiffReader::SampleFormat::floating_point;
  if (is_float && layout.bits_per_sample == 32) return read_channels<float>(tiff);
  if (is_float && layout.bits_per_sample == 64) return read_channels<double>(tiff);
  throw bad_input(file, "",
                  fmt::format("expected floating point samples of 32 bit, found {} of {} bit",
                              is_float ? "ones" : "integers", layout.bits_per_sample));
}

std::vector<Image<float>> read_float_tiff(const std::filesystem::path& file, int channels) {
  auto images = read_float_tiff(file);
  if (images.size() != static_cast<std::size_t>(channels))
    throw bad_input(file, "", fmt::format("expected {} channels, found {}", channels, images.size()));
  return images;
}

void write_float_tiff(const std::filesystem::path& file, std::span<const ImageView<const float>> channels) {
  if (channels.empty() || channels[0].empty()) throw std::invalid_argument("write_float_tiff: nothing to write");
  for (const auto& channel : channels)
    if (channel.width() != channels[0].width() || channel.height() != channels[0].height())
      throw std::invalid_argument("write_float_tiff: the channels' sizes differ");
  AtomicFile output(file);
  {
    TiffWriter writer(output.temporary());
    if (!writer.tiff) throw cannot_write(file, writer.message);
    set_tags(writer.tiff, channels[0].width(), channels[0].height(), static_cast<int>(channels.size()));
    if (!write_strips(writer.tiff, channels)) throw cannot_write(file, writer.message);
  }
  output.commit();
}

void write_float_tiff(const std::filesystem::path& file, std::initializer_list<ImageView<const float>> channels) {
  write_float_tiff(file, std::span(channels.begin(), channels.size()));
}

Image<Eigen::Vector3f> read_vector_tiff(const std::filesystem::path& file) {
  const auto channels = read_float_tiff(file, 3);
  Image<Eigen::Vector3f> vectors(channels[0].width(), channels[0].height(), Eigen::Vector3f::Zero());
  for (std::size_t i = 0; i < vectors.size(); ++i)
    vectors.data()[i] = {channels[0].data()[i], channels[1].data()[i], channels[2].data()[i]};
  return vectors;
}

void write_vector_tiff(const std::filesystem::path& file, const Image<Eigen::Vector3f>& vectors) {
  std::vector<Image<float>> channels(3, Image<float>(vectors.width(), vectors.height()));
  for (std::size_t i = 0; i < vectors.size(); ++i)
    for (int c = 0; c < 3; ++c) channels[static_cast<std::size_t>(c)].data()[i] = vectors.data()[i][c];
  write_float_tiff(file, {channels[0].view(), channels[1].view(), channels[2].view()});
}

ScanMap read_scan_map(const std::filesystem::path& file) {
  auto channels = read_float_tiff(file, 2);
  ScanMap map;
  map.u = std::move(channels[0]);
  map.v = std::move(channels[1]);
  return map;
}

void write_scan_map(const std::filesystem::path& file, const ScanMap& map) {
  write_float_tiff(file, {map.u.view(), map.v.view()});
}

}  // namespace pagesweep
