// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

namespace pagesweep::sim {

/// An ICC profile (version 4.3, ICC.1:2010) that says: these samples are sRGB (IEC 61966-2-1).
std::vector<std::byte> make_srgb_profile();

}  // namespace pagesweep::sim
