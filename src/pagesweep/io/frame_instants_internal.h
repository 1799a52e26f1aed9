// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "pagesweep/io/capture_file.h"

namespace pagesweep {

/// An instant at which cameras were triggered, or should have been.
struct Instant {
  int index = 0;
  int number = -1;               ///< of the frames in the capture; -1: the trigger was lost
  std::vector<float> late = {};  ///< see FrameSet::late
};

/// All instants of a capture in their order: its frames one after the other or, where it has timestamps, at their times
/// on an even beat. The time of a trigger is that of the first camera that saw it, with the other clocks set by what
/// was seen together: one trigger has one time. A frame without a timestamp counts as dropped.
/// \throws Error  if the timestamps do not belong to one sweep
std::vector<Instant> instants_of(const Capture& capture);

/// What a sequence is when its frames lie at these instants.
Sequence on_instants(Sequence sequence, const std::vector<Instant>& instants);

}  // namespace pagesweep
