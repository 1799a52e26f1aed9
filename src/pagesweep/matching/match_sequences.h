// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/data/frames.h"
#include "pagesweep/matching/match_epipolar.h"

namespace pagesweep {

/// Corresponding pixels by their whole gray value sequences, for any sequence of patterns (paper III.A, eq. 1-2):
/// minimises SSD(p, l) over the places l of p's true epipolar curve, with linear sub-pixel interpolation of the other
/// camera's sequences. A frame that either camera dropped is left out; a clipped sample counts as the saturation value,
/// so that clipped agrees with clipped. Both directions must agree.
///
/// Memory: two bytes for each sample of both cameras, and some 20 a pixel.
/// \throws std::invalid_argument  if frames and camera differ in size, or near_mm, far_mm contradict each other
/// \throws Error  no_result if the cameras share fewer than 3 frames
MatchPair match_sequences(const Frames& first, const Frames& second, const RayTable& first_camera,
                          const RayTable& second_camera, const MatchOptions& options = {},
                          Progress& progress = no_progress());

}  // namespace pagesweep
