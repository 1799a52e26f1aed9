// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/data/spot_offsets.h"
#include "pagesweep/data/time_map.h"

namespace pagesweep {

/// The spots' middles as the amplitudes tell them, for a point spread function of variance 1 px^2: the gradient of the
/// logarithm of the amplitude (Tweedie's formula; B. Efron, Tweedie's formula and selection bias, 2011). For a Gaussian
/// point spread function it is exact up to the amplitudes' noise and sampling. See docs/derivations/edges.md.
SpotOffsets offsets_from_amplitude(const TimeMap& times);

/// What a map of time values says about spot offsets.
struct EdgeCorrection {
  double gain = 0;      ///< by which the offsets explain the times best; 0: not at all
  double scatter = 0;   ///< rms of what they leave, over |gain offset . gradient of time| and beyond noise
  double before = 1;    ///< rms of the times of pixels with offsets against the times around, over their sigma
  double after = 1;     ///< the same when corrected
  long long edges = 0;  ///< pixels whose offset is large enough to be seen
};

/// Compares each time value with the plane through those around it: across a print edge it is off by
/// gain offset . gradient(time), if the offsets are true. The gain is fitted robustly.
/// \throws std::invalid_argument  if the sizes differ
EdgeCorrection fit_edges(const TimeMap& times, const SpotOffsets& offsets);

/// Moves time values from the middles of the spots, where they are true, to the pixels' centres; sigma grows by what
/// the correction leaves open. Pixels without an offset are left alone.
/// \throws std::invalid_argument  if the sizes differ
void correct_edges(TimeMap& times, const SpotOffsets& offsets, const EdgeCorrection& correction);

}  // namespace pagesweep
