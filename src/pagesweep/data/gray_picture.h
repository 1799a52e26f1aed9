// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/base/image.h"
#include "pagesweep/data/picture.h"

namespace pagesweep {

/// A picture's luma on the scale 0 to 255, whatever its depth: of RGB 0.299 R + 0.587 G + 0.114 B (ITU-R BT.601), of
/// gray the samples themselves. Samples stay encoded as they are.
Image<float> gray_picture(const Picture& picture);

}  // namespace pagesweep
