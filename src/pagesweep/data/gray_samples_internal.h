// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

namespace pagesweep {

/// How a sensor's gray values become samples.
struct GrayScale {
  float black;    ///< [gray values] without light
  float clipped;  ///< first gray value that is clipped
  float factor;   ///< by which what is above black is multiplied
};

/// out[k] = factor (in[k] - black), +infinity where in[k] is clipped.
/// \return whether one is
bool to_samples(const std::uint8_t* in, const GrayScale& scale, std::span<float> out);
bool to_samples(const std::uint16_t* in, const GrayScale& scale, std::span<float> out);

}  // namespace pagesweep
