// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/base/image.h"
#include "pagesweep/data/picture.h"

namespace pagesweep {

/// The picture as light, 0 to 1: its samples taken for sRGB (IEC 61966-2-1), mean of the channels.
Image<float> linear_light(const Picture& picture);

}  // namespace pagesweep
