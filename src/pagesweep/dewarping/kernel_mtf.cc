// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/dewarping/kernel_mtf.h"

#include <cmath>
#include <numbers>
#include <vector>

#include "pagesweep/dewarping/kernel_table_internal.h"

namespace pagesweep {

double kernel_mtf(ResampleKernel kernel, double width, double frequency_per_px) {
  constexpr int phases = 64;
  std::vector<float> weights(static_cast<std::size_t>(taps_of(kernel, width)));
  double real = 0, imaginary = 0;
  for (int phase = 0; phase < phases; ++phase) {
    const double fraction = (phase + 0.5) / phases;
    compute_weights(kernel, width, fraction, weights);
    for (std::size_t k = 0; k < weights.size(); ++k) {
      const double place = first_tap(static_cast<int>(weights.size())) + static_cast<int>(k) - fraction;
      const double angle = 2 * std::numbers::pi * frequency_per_px * place;
      real += double(weights[k]) * std::cos(angle) / phases;
      imaginary += double(weights[k]) * std::sin(angle) / phases;
    }
  }
  return std::hypot(real, imaginary);
}

}  // namespace pagesweep
