// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace pagesweep {

/// Adds to a JPEG 2000 file what OpenJPEG leaves out of it (ISO/IEC 15444-1, annex I: boxes `res ` and `colr` in
/// `jp2h`; a `uuid` box with the XMP packet behind it, ISO 16684-3).
/// \param jp2            the whole file; one without header is returned as it is
/// \param pixels_per_mm  capture resolution; 0: none
/// \param icc_profile    takes the place of the enumerated colour space; empty: none
/// \param xmp            empty: none
std::string complete_jp2_header(std::string jp2, double pixels_per_mm, std::span<const std::byte> icc_profile,
                                std::span<const std::byte> xmp);

struct Jp2Header {
  double pixels_per_mm = 0;            ///< across, of the capture or, failing that, the display; 0: none
  std::vector<std::byte> icc_profile;  ///< empty: none
  std::vector<std::byte> xmp;          ///< empty: none before the picture itself
};

/// \param jp2  the file, or its beginning
Jp2Header read_jp2_header(std::string_view jp2);

}  // namespace pagesweep
