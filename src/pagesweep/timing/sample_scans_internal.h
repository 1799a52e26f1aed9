// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace pagesweep {

/// What some samples of a pixel show.
struct SampleScan {
  float low, high;  ///< of those that are seen; infinity and 0 if none is
  int seen;         ///< are there and not clipped
  int clipped;      ///< are there, and clipped
};
/// All arrays must reach 16 entries beyond `count`.
/// \param gray     +infinity: clipped
/// \param present  for each sample 1 if it is there, else 0
SampleScan scan_samples(const float* gray, const float* present, int count);

/// Sums of squared slopes that samples of a bell do not show, of its rising flank and of its falling one.
struct LostSlopes {
  float absent[2], clipped[2];
};
LostSlopes lost_slopes(const float* slope, const float* gray, const float* present, int count);

}  // namespace pagesweep
