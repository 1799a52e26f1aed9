// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>

#include "pagesweep/matching/match_epipolar.h"
#include "pagesweep/matching/sequence_kernels_internal.h"

namespace pagesweep {

/// Some pixels' sequences g and, for each, the sequences S_0 ... S_3 where an epipolar curve crosses the other camera's
/// pixel grid, by their inner products: all that a sum of squared differences between them depends on. One entry a
/// pixel.
struct PlaceBatch {
  static constexpr int most = 16;
  static constexpr std::size_t crossings = Crossings::count;
  using Each = std::array<float, most>;

  std::size_t count = most;  ///< pixels
  double samples = 1;        ///< frames of a sequence
  double freedom = 1;        ///< samples less the unknowns

  alignas(64) Each gg{};                                                ///< g . g
  alignas(64) std::array<Each, crossings> gs{};                         ///< g . S_i
  alignas(64) std::array<std::array<Each, crossings>, crossings> ss{};  ///< S_i . S_j, where i <= j
  /// Squared weights of the pixels that S_i was interpolated from: what is left of their noise.
  alignas(64) std::array<Each, crossings> noise_share{};
  alignas(64) std::array<Each, crossings> usable{};  ///< 1 where the other camera has S_i, else 0

  alignas(64) Each share{};     ///< the place, from crossing 1 (0) to crossing 2 (1); NaN if one of them is missing
  alignas(64) Each is_cubic{};  ///< 1 where four crossings were there for the cubic; else it is linear
  alignas(64) Each distance_squared{};  ///< of the sequences, eq. 1
  alignas(64) Each noise_variance{};    ///< of a sample of the other camera, if both share in the residual alike
  alignas(64) Each gain{};              ///< by which the interpolated sequence is scaled
  alignas(64) Each doubt{};  ///< [crossings] that the interpolation leaves: as much as linear and cubic differ
  /// Sum over the frames of the squared change a crossing, without what a gain could mimic and what is but noise.
  alignas(64) Each change_squared{};
  alignas(64) Each change_along_own{};  ///< part of the interpolated sequence's change that a gain could mimic, in g
  /// [crossings] standard deviation of the place if residuals are alike in all frames; infinite if nothing changes.
  alignas(64) Each sigma{};
};

/// Weights of the four crossings in an interpolated sequence, and their changes a crossing.
struct CrossingWeights {
  std::array<double, PlaceBatch::crossings> value, change;
};
CrossingWeights linear_weights(double share);
CrossingWeights cubic_weights(double share);  ///< Catmull-Rom

/// Where, between crossings 1 and 2, the interpolated sequences come nearest to g (eq. 2).
///
/// Interpolated linearly, the sequences are a line in as many dimensions as there are frames, and the nearest point has
/// a closed form: with normalisation none, the foot of g on the line; with affine, where the gain is free too, g
/// projected onto the plane of S_1 and S_2 (means are zero, so the offset is gone). Noise is independent from crossing
/// to crossing, so that a mixture of two has less of it, and a sum of squared differences that counts it is drawn
/// towards the middle: its expected part is taken out of the products. With interpolation cubic, and the four crossings
/// that it needs, Gauss-Newton steps go on from there along the Catmull-Rom curve through the crossings; `doubt` is how
/// far they lead, either way.
void find_nearest_places(PlaceBatch& batch, Normalisation normalisation, Interpolation interpolation);

}  // namespace pagesweep
