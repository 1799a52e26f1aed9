// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "pagesweep/base/image.h"

namespace pagesweep {

/// Direction of the text lines on a flat page by its projection profile: along the right direction, lines and the gaps
/// between them project to the sharpest profile.
/// \param brightness  0 to 1, NaN where unknown
/// \param max_rad     directions from -max_rad to max_rad are tried
/// \return [rad] from the right (x) towards down (y); nothing if no direction stands out: no text, or text all over
std::optional<double> find_text_direction(const Image<float>& brightness, double max_rad);

}  // namespace pagesweep
