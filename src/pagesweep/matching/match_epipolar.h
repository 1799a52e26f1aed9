// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string_view>

#include "pagesweep/base/enum_names.h"
#include "pagesweep/base/progress.h"
#include "pagesweep/camera/ray_table.h"
#include "pagesweep/data/correspondences.h"
#include "pagesweep/data/time_map.h"

namespace pagesweep {

/// What is done to a gray value sequence before it is compared with another camera's.
enum class Normalisation {
  none,    ///< nothing: eq. 1 as it stands; right where both cameras see the paper equally bright
  affine,  ///< a gain and an offset for each pair of pixels are free, as in eq. 3: gloss and different lenses
};
constexpr auto names_of(Normalisation) { return std::array<std::string_view, 2>{"none", "affine"}; }

/// How a gray value sequence between pixels is made from theirs, along the epipolar curve; across it, linearly.
enum class Interpolation {
  linear,  ///< as in the paper; at fine stripes it attenuates, which draws matches towards pixel centres
  cubic,   ///< Catmull-Rom
};
constexpr auto names_of(Interpolation) { return std::array<std::string_view, 2>{"linear", "cubic"}; }

struct MatchOptions {
  double near_mm = 0;
  double far_mm = 0;
  double max_disagreement_px = 0.5;
  double max_sigma_px = 1;
  Normalisation normalisation = Normalisation::affine;
  Interpolation interpolation = Interpolation::cubic;
  double min_modulation = 0.04;
  double max_dissimilarity = 0.3;
  double min_distinction = 0.04;

  template <class Visitor>
  void describe(Visitor&& visit) {
    visit("near", near_mm, "mm", "nearest surface along a camera's optical axis; 0: found automatically");
    visit("far", far_mm, "mm", "farthest surface along a camera's optical axis; 0: found automatically");
    visit("max-disagreement", max_disagreement_px, "px",
          "matching there and back may end this far from where it began (or 4 standard deviations, if more)");
    visit("max-match-sigma", max_sigma_px, "px", "a match known less well than this is ambiguous");
    visit("normalisation", normalisation, "", "sequence matcher: what may differ between the cameras' gray values");
    visit("interpolation", interpolation, "", "sequence matcher: how sequences between pixels are made");
    visit("min-modulation", min_modulation, "of full scale",
          "sequence matcher: a pixel whose gray values vary less is too dark to be matched");
    visit("max-dissimilarity", max_dissimilarity, "of the sequence's energy",
          "sequence matcher: largest sum of squared differences that still is a match");
    visit("min-distinction", min_distinction, "of the sequence's energy",
          "sequence matcher: another place that is worse by less than this makes a match ambiguous");
  }
};

struct MatchPair {
  Correspondences from_first;   ///< for each pixel of the first camera, the place in the second
  Correspondences from_second;  ///< and the other way
};

/// Corresponding pixels by equal time values (paper III.B, from [13]): for each pixel, the place on its true, distorted
/// epipolar curve in the other camera where that camera's time map has the same time value.
///
/// Times are interpolated bilinearly, never across invalid pixels nor across a jump of the time map. The root is
/// bracketed; sigma follows from both time values' sigma and the slope of time along the curve. Both directions must
/// agree. docs/derivations/matching.md has the equations and says when a pixel gets which status.
/// \throws std::invalid_argument  if a map's size is not its camera's, or near_mm, far_mm contradict each other
MatchPair match_times(const TimeMap& first, const TimeMap& second, const RayTable& first_camera,
                      const RayTable& second_camera, const MatchOptions& options = {},
                      Progress& progress = no_progress());

}  // namespace pagesweep
