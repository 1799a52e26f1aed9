// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <variant>
#include <vector>

#include "pagesweep/base/image.h"

namespace pagesweep {

/// A picture for people: the scanner's scan, a finished page. 8 or 16 bit, gray or RGB, with what its file
/// says about it. Samples of a pixel are neighbours: sample c of pixel (x, y) is at column x * channels + c.
struct Picture {
  std::variant<Image<std::uint8_t>, Image<std::uint16_t>> samples;
  int channels = 1;                                        ///< 1 (gray) or 3 (RGB)
  double pixels_per_mm = 0;                                ///< from the file's resolution; 0: unknown
  std::vector<std::byte> icc_profile;                      ///< empty: none
  std::map<std::string, std::vector<std::byte>> metadata;  ///< raw blobs by kind: "exif", "xmp", "iptc"

  int width() const;   ///< [px]
  int height() const;  ///< [px]
  int bit_depth() const { return samples.index() == 0 ? 8 : 16; }
};

/// An empty picture of that size with all samples 0, and neither resolution nor metadata.
Picture make_picture(int width, int height, int channels, int bit_depth);

}  // namespace pagesweep
