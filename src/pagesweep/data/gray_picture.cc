// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/data/gray_picture.h"

#include "pagesweep/base/parallel.h"

namespace pagesweep {

Image<float> gray_picture(const Picture& picture) {
  Image<float> gray(picture.width(), picture.height());
  const float scale = picture.bit_depth() == 8 ? 1 : 1 / 257.0F;
  const auto convert = [&](const auto& samples, int y) {
    const auto row = samples.row(y);
    for (std::size_t x = 0; x < static_cast<std::size_t>(gray.width()); ++x)
      gray(static_cast<int>(x), y) =
          scale * (picture.channels == 1
                       ? float(row[x])
                       : 0.299F * float(row[3 * x]) + 0.587F * float(row[3 * x + 1]) + 0.114F * float(row[3 * x + 2]));
  };
  parallel_rows(gray.height(),
                [&](int y) { std::visit([&](const auto& samples) { convert(samples, y); }, picture.samples); });
  return gray;
}

}  // namespace pagesweep
