// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "pagesweep/base/enum_names.h"

namespace pagesweep {

/// Why a pixel has, or lacks, a value. One list for all stations, so that the reason travels from the
/// station that found it to the report. A missing value is data, not an exception.
enum class PixelStatus : std::uint8_t {
  ok,             ///< the value is valid
  not_computed,   ///< no station has looked at this pixel
  too_dark,       ///< the bell rises less than `min_amplitude` above the background
  truncated,      ///< the stripe entered or left during the recording: only a flank was seen
  saturated,      ///< too few samples below saturation remained (eq. 10)
  bad_fit,        ///< the gray value sequence is not the stripe's: gloss, interreflection, a moving thing
  outside_view,   ///< the epipolar curve, within the depth range, is outside the other camera's picture
  no_match,       ///< nothing on the epipolar curve agrees with this pixel
  ambiguous,      ///< more than one place on the epipolar curve agrees
  inconsistent,   ///< matching back from the other camera ends at another pixel
  outside_depth,  ///< the triangulated point is outside the depth range
  rays_miss,      ///< the two viewing rays pass each other too far apart
  off_surface,    ///< an outlier to the surface around it
  hidden,         ///< the spot is not seen: occluded, or outside the scan
  covered,        ///< something that is not the paper stands above it: a finger, a clip, a slip of paper
};

constexpr auto names_of(PixelStatus) {
  return std::array<std::string_view, 15>{
      "ok",        "not_computed", "too_dark",      "truncated", "saturated",   "bad_fit", "outside_view", "no_match",
      "ambiguous", "inconsistent", "outside_depth", "rays_miss", "off_surface", "hidden",  "covered"};
}

}  // namespace pagesweep
