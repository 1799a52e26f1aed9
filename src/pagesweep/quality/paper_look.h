// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <variant>
#include <vector>

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

/// Luminance of a picture's pixels, 0 to 1: samples through its tone curve, weighted 0.2126, 0.7152, 0.0722.
class PictureLight {
 public:
  explicit PictureLight(const Picture& picture);  ///< must outlive this
  int width() const { return picture_->width(); }
  int height() const { return picture_->height(); }
  float at(int x, int y) const {
    return std::visit([&](const auto& samples) { return light_of(&samples(x * picture_->channels, y)); },
                      picture_->samples);
  }

 private:
  template <class T>
  float light_of(const T* pixel) const {
    return picture_->channels == 3
               ? 0.2126f * lights_[pixel[0]] + 0.7152f * lights_[pixel[1]] + 0.0722f * lights_[pixel[2]]
               : lights_[pixel[0]];
  }

  const Picture* picture_;
  std::vector<float> lights_;  ///< of every sample
};

/// That of each pixel of a page; NaN where the scan map says that the scan shows nothing.
Image<float> light_of_page(const Page& page);

}  // namespace pagesweep
