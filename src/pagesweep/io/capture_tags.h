// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

namespace pagesweep {

/// What a scanner writes into its pictures about itself and the moment; "" where it does not. TIFF 6.0 and EXIF have
/// the same tags.
struct CaptureTags {
  std::string description;  ///< ImageDescription
  std::string make;         ///< Make: who built the scanner
  std::string model;        ///< Model
  std::string software;     ///< Software
  std::string date_time;    ///< DateTimeOriginal or, failing that, DateTime: "2026:11:22 18:04:00"
  std::string artist;       ///< Artist
  std::string copyright;    ///< Copyright

  bool empty() const;
};

/// Reads an EXIF blob ("Exif\0\0", then a TIFF header). What is broken in it is left out.
CaptureTags read_exif(std::span<const std::byte> exif);

/// Makes such a blob. What is not ASCII is written as it is.
std::vector<std::byte> make_exif(const CaptureTags& tags);

/// "2026:11:22 18:04:00" as XMP and METS write it: "2026-11-22T18:04:00"; "" if it is no date.
std::string iso_date(const std::string& exif_date);

}  // namespace pagesweep
