// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "pagesweep/data/status.h"

namespace pagesweep {

/// A colour for screens: sRGB, 8 bit a channel.
struct Rgb {
  std::uint8_t r = 0, g = 0, b = 0;
  bool operator==(const Rgb&) const = default;
};

/// What is shown where a map has no value.
inline constexpr Rgb no_value_colour{214, 216, 219};

/// How numbers become colours.
enum class Ramp {
  sequential,  ///< sizes: dark violet, over teal, to light yellow; lightness (CIE L*) grows evenly
  diverging,   ///< deviations: blue below 0, near-white at 0, red above
  gray,        ///< light: black to white
};

/// \param share  0 to 1 from the ramp's low to its high end, clamped; NaN: no_value_colour
Rgb colour_of(Ramp ramp, double share);

/// One hue a reason, light green where all is well.
Rgb colour_of(PixelStatus status);

/// "#0a141e"
std::string css_colour(Rgb colour);
/// "linear-gradient(to right, #..., ...)"
std::string css_gradient(Ramp ramp);

}  // namespace pagesweep
