// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "pagesweep/data/picture.h"

namespace pagesweep {

/// A picture with samples of 8 bit: of 16 bit the nearest.
Picture with_8_bit(const Picture& picture);

/// A JPEG file in memory, without profile and metadata: what a PDF embeds. 16 bit become 8.
/// \param quality  1 (small) to 100 (good)
std::string encode_jpeg(const Picture& picture, int quality);

/// A JPEG 2000 file in memory as write_picture() writes it, without loss, but without metadata.
std::string encode_jp2(const Picture& picture);

}  // namespace pagesweep
