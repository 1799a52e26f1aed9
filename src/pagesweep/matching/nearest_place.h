// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <limits>

#include "pagesweep/matching/match_epipolar.h"

namespace pagesweep {

/// One pixel's sequence g and the sequences S_i where an epipolar curve crosses the other camera's pixel grid, by their
/// inner products: all that a sum of squared differences between them depends on.
struct SequenceProducts {
  static constexpr int crossings = 6;

  double gg = 0;                                   ///< g . g
  Eigen::Matrix<double, crossings, 1> gs;          ///< g . S_i
  Eigen::Matrix<double, crossings, crossings> ss;  ///< S_i . S_j
  std::array<bool, crossings> usable{};            ///< whether the other camera has S_i
};

/// A place between two crossings.
struct CurvePlace {
  int segment = -1;     ///< it lies between crossings segment and segment + 1; -1: there is none
  double share = 0;     ///< of the way from the one to the other
  bool at_end = false;  ///< nothing is known beyond, where an even nearer place may be
  double distance_squared = std::numeric_limits<double>::infinity();  ///< of the sequences, eq. 1
  double gain = 1;                                                    ///< by which the interpolated sequence is scaled
  double doubt = 0;  ///< [crossings] that the interpolation leaves: as much as linear and cubic differ
  /// The interpolated sequence is the sum of value_k S_(segment - 1 + k); derivative_k gives its change a crossing.
  Eigen::Vector4d value, derivative;
};

/// Where the interpolated sequence comes nearest to g (eq. 2), on the three segments in the middle.
///
/// Interpolated linearly, the sequences are a polyline in as many dimensions as there are frames, and the nearest point
/// of each segment has a closed form: with normalisation none, the foot of g on the segment; with affine, where the
/// gain is free too, g projected onto the plane of S_i and S_(i+1) (means are zero, so the offset is gone).
CurvePlace nearest_on_polyline(const SequenceProducts& products, Normalisation normalisation);

/// The same on the Catmull-Rom curve through the crossings, by Gauss-Newton steps from `start`, if that has the four
/// crossings that it needs. Either way, `doubt` is how far the two places are apart.
CurvePlace nearest_place(const SequenceProducts& products, const CurvePlace& start, Normalisation normalisation,
                         Interpolation interpolation);

/// The squared distance at a place by other products.
double distance_squared(const SequenceProducts& products, const CurvePlace& place, Normalisation normalisation);

}  // namespace pagesweep
