// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include "pagesweep/data/picture.h"

namespace pagesweep {

/// An ICC profile that says: these samples are sRGB (IEC 61966-2-1). Of version 2.1 (ICC.1:1998-09) and a matrix with
/// curves, which is all that JPEG 2000 allows.
std::vector<std::byte> make_srgb_profile();
/// The same for one channel of gray: the tone curve of sRGB.
std::vector<std::byte> make_gray_profile();

/// Whether a picture has a profile and that is one for as many channels as the picture has.
bool fits_profile(const Picture& picture);

/// Gives a picture without a profile that fits one of those above: what such samples are taken for anyway.
void complete_profile(Picture& picture);

}  // namespace pagesweep
