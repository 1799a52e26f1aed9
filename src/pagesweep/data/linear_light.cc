// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/data/linear_light.h"

#include <cmath>
#include <limits>
#include <type_traits>
#include <vector>

#include "pagesweep/base/parallel.h"

namespace pagesweep {
namespace {

/// Light of an sRGB sample between 0 and 1.
float light_of(double sample) {
  return static_cast<float>(sample <= 0.04045 ? sample / 12.92 : std::pow((sample + 0.055) / 1.055, 2.4));
}

}  // namespace

Image<float> linear_light(const Picture& picture) {
  Image<float> light(picture.width(), picture.height());
  std::visit(
      [&](const auto& samples) {
        const int highest = std::numeric_limits<std::decay_t<decltype(samples(0, 0))>>::max();
        std::vector<float> table(static_cast<std::size_t>(highest) + 1);
        for (int i = 0; i <= highest; ++i)
          table[static_cast<std::size_t>(i)] =
              light_of(static_cast<double>(i) / highest) / static_cast<float>(picture.channels);
        parallel_rows(light.height(), [&](int y) {
          const auto* sample = samples.row(y).data();
          for (float& pixel : light.row(y)) {
            float sum = 0;
            for (int c = 0; c < picture.channels; ++c) sum += table[*sample++];
            pixel = sum;
          }
        });
      },
      picture.samples);
  return light;
}

}  // namespace pagesweep
