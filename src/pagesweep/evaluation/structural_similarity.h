// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/base/image.h"

namespace pagesweep {

/// Multi-scale structural similarity (Z. Wang, E. P. Simoncelli, A. C. Bovik, Asilomar Conference 2003) of two gray
/// pictures whose values go from 0 to 255: five scales, each half as fine as the one before, Gaussian windows of 11 x
/// 11 with standard deviation 1.5, the paper's weights, constants (0.01 255)^2 and (0.03 255)^2. 1 if they are equal.
/// Windows that do not lie wholly inside the picture are left out.
/// \return  NaN if the pictures are smaller than 11 x 16 pixels on a side, of which a window is left at the coarsest
/// scale
/// \throws std::invalid_argument  if the sizes differ
double ms_ssim(ImageView<const float> a, ImageView<const float> b);

}  // namespace pagesweep
