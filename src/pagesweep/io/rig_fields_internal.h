// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>

#include "pagesweep/io/json_reader.h"

namespace pagesweep {

// What every file that describes a rig has to keep to.

constexpr int widest_px = 200'000;  ///< no camera or scanner has more; keeps width x height in an int's reach
constexpr double longest = 1e9;     ///< [mm, px] what is beyond is a mistake and would overflow somewhere

/// Where a range may not include its end.
inline double positive(const JsonReader& json) {
  const double value = json.number();
  if (!(value > 0 && value <= longest)) throw json.error(fmt::format("expected a number above 0, found {}", value));
  return value;
}

/// Whether results of a camera can be named after it.
inline bool is_camera_name(std::string_view name) {
  return !name.empty() && name.front() != '.' && name.find('/') == std::string_view::npos &&
         name.find('\0') == std::string_view::npos;
}

}  // namespace pagesweep
