// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "pagesweep/data/pixel_set.h"
#include "pagesweep/data/spot_offsets.h"
#include "pagesweep/data/time_map.h"

namespace pagesweep {

/// The spots' middles as the amplitudes tell them, for a point spread function of variance 1 px^2: the gradient of the
/// logarithm of the amplitude (Tweedie's formula; B. Efron, Tweedie's formula and selection bias, 2011). For a Gaussian
/// point spread function it is exact up to the amplitudes' noise and sampling. See docs/derivations/edges.md.
SpotOffsets offsets_from_amplitude(const TimeMap& times);

/// How one pixel's time compares with the plane through those around it.
struct EdgeComparison {
  int x, y;          ///< the pixel
  float misfit;      ///< [frames] own time less the plane's
  float leaning;     ///< [frames] offset . gradient of time
  float offset_px;   ///< length of the offset
  float pixel;       ///< [frames] that the stripe takes over a pixel of the surface
  bool one_surface;  ///< there is no step in depth nearby
};
using EdgeComparisons = std::vector<EdgeComparison>;

/// Compares each time value whose offset could matter with the plane through those around it: where offset times
/// steepness is far below the value's standard deviation, there is nothing to compare.
/// \throws std::invalid_argument  if the sizes differ
/// \param only  other pixels are not compared; null: all pixels
EdgeComparisons compare_with_surroundings(const TimeMap& times, const SpotOffsets& offsets,
                                          const PixelSet* only = nullptr);
/// With offsets_from_amplitude().
EdgeComparisons compare_by_amplitude(const TimeMap& times, const PixelSet* only = nullptr);

/// What a map of time values says about spot offsets.
struct EdgeCorrection {
  double gain = 0;      ///< by which the offsets explain the times best; 0: not at all
  double scatter = 0;   ///< rms of what they leave, over |gain offset . gradient of time| and beyond noise
  double before = 1;    ///< rms of the times of pixels with offsets against the times around, over their sigma
  double after = 1;     ///< the same when corrected
  long long edges = 0;  ///< pixels whose offset is large enough to be seen
};

/// Across a print edge a time value is off by gain offset . gradient(time), if the offsets are true. The gain is fitted
/// robustly to the pixels that were compared so far; one that is not significant is 0.
class EdgeFit {
 public:
  /// \param times  those that were compared
  void add(const TimeMap& times, const EdgeComparisons& comparisons);
  EdgeCorrection fit();
  /// Whether the next fit can be another than the last one.
  bool has_news() const { return edges_.size() > fitted_; }

 private:
  struct Edge {
    float leaning, misfit;  ///< both over the time value's sigma
  };
  struct Sums;
  static Sums sum(std::span<const Edge> edges, double gain, double limit);
  Sums gather(double gain, double limit) const;

  std::vector<Edge> edges_;
  std::size_t fitted_ = 0;  ///< how many there were at the last fit
};

/// The fit to all pixels that were compared.
EdgeCorrection fit_edges(const TimeMap& times, const EdgeComparisons& comparisons);

/// Moves time values from the middles of the spots, where they are true, to the pixels' centres; sigma grows by what
/// the correction leaves open. At a step in depth, where the spot lies on two surfaces, the time stays and sigma grows
/// by what the offset may be worth. Pixels without an offset are left alone.
/// \param times  those that were compared
void correct_edges(TimeMap& times, const EdgeComparisons& comparisons, const EdgeCorrection& correction);

}  // namespace pagesweep
