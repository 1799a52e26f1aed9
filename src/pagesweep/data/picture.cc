// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/data/picture.h"

#include <stdexcept>

namespace pagesweep {

int Picture::width() const {
  return std::visit([](const auto& image) { return image.width(); }, samples) / channels;
}

int Picture::height() const {
  return std::visit([](const auto& image) { return image.height(); }, samples);
}

Picture make_picture(int width, int height, int channels, int bit_depth) {
  if (channels != 1 && channels != 3) throw std::invalid_argument("a picture has 1 or 3 channels");
  Picture picture;
  picture.channels = channels;
  if (bit_depth == 8)
    picture.samples = Image<std::uint8_t>(width * channels, height);
  else if (bit_depth == 16)
    picture.samples = Image<std::uint16_t>(width * channels, height);
  else
    throw std::invalid_argument("a picture has 8 or 16 bit");
  return picture;
}

}  // namespace pagesweep
