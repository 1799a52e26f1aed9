// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "pagesweep/data/picture.h"
#include "pagesweep/io/image_file.h"

namespace pagesweep {

/// Writes a picture as TIFF 6.0: strips of some 64 KB, interleaved, with resolution, ICC profile, XMP and IPTC packets,
/// and what its EXIF blob says of the scanner in tags of its own. BigTIFF if it could become larger than 4 GB.
/// \throws std::runtime_error  if it cannot be written
void write_tiff(const std::filesystem::path& file, const Picture& picture, TiffCompression compression);

/// What the tags of a TIFF say of the scanner, as an EXIF blob; empty if nothing.
std::vector<std::byte> read_tiff_tags(const std::filesystem::path& file);

}  // namespace pagesweep
