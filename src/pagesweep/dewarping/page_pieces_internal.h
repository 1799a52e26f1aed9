// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/base/image.h"

namespace pagesweep {

/// Of the pieces of bright cells that are connected along rows or columns, those that belong to the page: they are
/// larger than a tenth of the largest one, or mostly measured. If any piece was measured, none that was not at all
/// belongs to it: that is another sheet.
Image<char> keep_page_pieces(const Image<char>& bright, const Image<char>& measured);

}  // namespace pagesweep
