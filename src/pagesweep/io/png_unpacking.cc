// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/png_unpacking_internal.h"

#include <libdeflate.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <new>
#include <span>
#include <string>
#include <vector>

namespace pagesweep {
namespace {

using Bytes = std::span<const std::uint8_t>;

constexpr std::size_t signature_size = 8, length_size = 4, type_size = 4, checksum_size = 4;

std::uint32_t big_endian(std::string_view bytes) {
  std::uint32_t number = 0;
  for (const char byte : bytes.substr(0, 4)) number = number << 8 | static_cast<std::uint8_t>(byte);
  return number;
}

/// Puts together what all IDAT chunks hold. \return whether every chunk is sound and the last one is IEND (PNG
/// specification, 5)
bool gather_pixels(std::string_view bytes, std::string& packed) {
  packed.clear();
  bytes.remove_prefix(std::min(signature_size, bytes.size()));
  while (bytes.size() >= length_size + type_size + checksum_size) {
    const std::size_t length = big_endian(bytes);
    bytes.remove_prefix(length_size);
    if (length > bytes.size() - type_size - checksum_size) return false;
    const std::string_view typed = bytes.substr(0, type_size + length), type = typed.substr(0, type_size);
    bytes.remove_prefix(typed.size());
    if (libdeflate_crc32(0, typed.data(), typed.size()) != big_endian(bytes)) return false;
    bytes.remove_prefix(checksum_size);
    if (type == "IEND") return true;
    if (type == "IDAT") packed += typed.substr(type_size);
  }
  return false;
}

/// \return whether exactly `unpacked.size()` bytes came out
bool inflate(std::string_view packed, std::span<std::uint8_t> unpacked) {
  const std::unique_ptr<libdeflate_decompressor, void (*)(libdeflate_decompressor*)> decompressor(
      libdeflate_alloc_decompressor(), libdeflate_free_decompressor);
  if (!decompressor) throw std::bad_alloc();
  return libdeflate_zlib_decompress(decompressor.get(), packed.data(), packed.size(), unpacked.data(), unpacked.size(),
                                    nullptr) == LIBDEFLATE_SUCCESS;
}

/// Whichever of left, above and above left is nearest to left + above - above left.
int paeth(int left, int above, int above_left) {
  const int to_left = std::abs(above - above_left), to_above = std::abs(left - above_left),
            to_above_left = std::abs(left + above - 2 * above_left);
  if (to_left <= to_above && to_left <= to_above_left) return left;
  return to_above <= to_above_left ? above : above_left;
}

/// Adds to each byte what predict(left, above, above left) says, the bytes of the same place in the neighbouring
/// samples.
template <int sample_bytes, class Predict>
void add_predictions(Bytes filtered, const std::uint8_t* above, std::uint8_t* row, const Predict& predict) {
  for (std::size_t k = 0; k < sample_bytes; ++k)
    row[k] = static_cast<std::uint8_t>(filtered[k] + predict(0, above[k], 0));
  for (std::size_t k = sample_bytes; k < filtered.size(); ++k)
    row[k] = static_cast<std::uint8_t>(filtered[k] + predict(row[k - sample_bytes], above[k], above[k - sample_bytes]));
}

/// Undoes a row's filter (PNG specification, 9). \return whether there is such a filter
template <int sample_bytes>
bool unfilter(int filter, Bytes filtered, const std::uint8_t* above, std::uint8_t* row) {
  const auto add = [&](const auto& predict) {
    add_predictions<sample_bytes>(filtered, above, row, predict);
    return true;
  };
  switch (filter) {
    case 0:
      return add([](int, int, int) { return 0; });
    case 1:
      return add([](int left, int, int) { return left; });
    case 2:
      return add([](int, int up, int) { return up; });
    case 3:
      return add([](int left, int up, int) { return (left + up) / 2; });
    case 4:
      return add(paeth);
    default:
      return false;
  }
}

}  // namespace

template <class T>
std::optional<Image<T>> unpack_gray_png(std::string_view bytes, int width, int height) {
  thread_local std::string packed;  // frame after frame: fresh memory would cost as much as half of the unpacking
  thread_local std::vector<std::uint8_t> filtered;
  if (!gather_pixels(bytes, packed)) return std::nullopt;
  const std::size_t row_bytes = static_cast<std::size_t>(width) * sizeof(T), filtered_bytes = 1 + row_bytes;
  filtered.resize(filtered_bytes * static_cast<std::size_t>(height));
  if (!inflate(packed, filtered)) return std::nullopt;

  Image<T> image(width, height, unfilled);
  const Image<T> nothing(width, 1, 0);
  const auto bytes_of = [](const T& sample) { return reinterpret_cast<const std::uint8_t*>(&sample); };
  for (int y = 0; y < height; ++y) {
    const std::uint8_t* row = &filtered[static_cast<std::size_t>(y) * filtered_bytes];
    const std::uint8_t* above = bytes_of(y == 0 ? nothing(0, 0) : image(0, y - 1));
    if (!unfilter<sizeof(T)>(row[0], {row + 1, row_bytes}, above, reinterpret_cast<std::uint8_t*>(&image(0, y))))
      return std::nullopt;
  }
  if (sizeof(T) == 2 && std::endian::native == std::endian::little)
    for (T& sample : image.pixels()) sample = static_cast<T>(sample << 8 | sample >> 8);
  return image;
}

template std::optional<Image<std::uint8_t>> unpack_gray_png(std::string_view bytes, int width, int height);
template std::optional<Image<std::uint16_t>> unpack_gray_png(std::string_view bytes, int width, int height);

}  // namespace pagesweep
