// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "pagesweep/data/picture.h"
#include "pagesweep/io/capture_tags.h"

namespace pagesweep {

/// What a finished page says about itself beside what the scan said. Empty: nothing.
struct PageMetadata {
  std::string title;
  std::string source;   ///< what it was made from
  std::string program;  ///< what made it: "pagesweep 0.1.0"
};

/// What the scan's own metadata say of the scanner and the moment.
CaptureTags capture_tags_of(const Picture& picture);

/// Puts an XMP packet into the picture's metadata: title, source and program, the scanner's maker, model and time from
/// the scan's own EXIF or TIFF tags, size and resolution. Other properties of an XMP packet that the scan had are kept.
/// No time of our own gets in: the same scan gives the same file.
void complete_metadata(Picture& picture, const PageMetadata& metadata);

}  // namespace pagesweep
