// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string_view>

#include "pagesweep/data/frames.h"
#include "pagesweep/io/image_file.h"

namespace pagesweep {

/// Decodes a single-channel PNG of 8 or 16 bit.
/// \param bytes  the whole file; `file` serves the messages only
/// \throws Error  if it is cut short, corrupt, or no such PNG
GrayImage decode_gray_png(std::string_view bytes, const std::filesystem::path& file, std::optional<ImageSize> expected);

}  // namespace pagesweep
