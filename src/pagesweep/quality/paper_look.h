// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/base/image.h"
#include "pagesweep/data/page.h"

namespace pagesweep {

/// How evenly lit, noisy and well exposed a page's blank paper is. NaN: too little blank paper to tell.
struct PaperLook {
  double level = 0;           ///< light of blank paper, 0 to 1; median of the cells
  double non_uniformity = 0;  ///< of the light of blank paper: 1 - darkest / brightest, without 2 % at either end
  double noise_l_star = 0;    ///< standard deviation of CIE L* within blank millimetres, median
  double clipped_white = 0;   ///< share of the page's pixels with a sample at the top of the range
  double clipped_black = 0;   ///< share with all samples at 0
  double pitch_mm = 5;        ///< of the cells below
  Image<float> levels;        ///< light of blank paper in each cell; NaN where there is none
};

/// \param light  of the page, 0 to 1, NaN where it shows nothing (see light_of_page())
PaperLook look_at_paper(const Page& page, const Image<float>& light);

/// Luminance of each pixel, 0 to 1: samples through the picture's tone curve, weighted 0.2126, 0.7152, 0.0722. NaN
/// where the scan map says that the scan shows nothing.
Image<float> light_of_page(const Page& page);
/// Likewise of a whole picture.
Image<float> light_of_picture(const Picture& picture);

}  // namespace pagesweep
