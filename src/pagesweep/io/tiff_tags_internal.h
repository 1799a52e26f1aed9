// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

/// What of TIFF 6.0, and of BigTIFF, its variant with 64 bit offsets, a recording is made of.
namespace pagesweep::tiff {

enum Tag : std::uint16_t {
  image_width = 256,
  image_length = 257,
  bits_per_sample = 258,
  compression = 259,
  photometric = 262,
  fill_order = 266,
  strip_offsets = 273,
  samples_per_pixel = 277,
  rows_per_strip = 278,
  strip_byte_counts = 279,
  tile_width = 322,
  sample_format = 339,
};

enum Type : std::uint16_t { short_type = 3, long_type = 4, long8_type = 16 };

constexpr std::uint16_t not_compressed = 1, black_is_zero = 1, unsigned_samples = 1, highest_bit_first = 1;

/// Where TIFF and BigTIFF differ: lengths in bytes.
struct Layout {
  std::uint16_t version;
  std::uint64_t header;   ///< what the file begins with; its last bytes are the offset of the first directory
  std::uint64_t counter;  ///< of a directory's entries, in front of them
  std::uint64_t entry;    ///< tag and type of two bytes each, count, value
  std::uint64_t offset;   ///< also of a count, and of a value that stands in its entry
};
constexpr Layout classic_layout{42, 8, 2, 12, 4};
constexpr Layout big_layout{43, 16, 8, 20, 8};

}  // namespace pagesweep::tiff
