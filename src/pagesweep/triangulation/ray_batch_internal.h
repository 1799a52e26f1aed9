// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>

#include "pagesweep/camera/camera.h"

namespace pagesweep {

/// Two cameras, made ready to intersect a million pairs of their viewing rays.
struct RayPair {
  RayPair(const Camera& from, const Camera& to);

  std::array<double, 9> to_from_from;   ///< rotation, row by row
  std::array<double, 3> origin;         ///< of the first camera's rays [mm], in the second camera's frame
  std::array<double, 9> rig_from_from;  ///< rotation, row by row
  std::array<double, 3> center;         ///< of the first camera [mm], in the rig's frame
  double fx, fy;                        ///< of the second camera
  BrownConrady lens;                    ///< of the second camera
};

/// Pairs of viewing rays, one entry a pair: directions (X/Z, Y/Z) in their cameras' frames.
struct RayBatch {
  static constexpr std::size_t most = 64;
  using Each = std::array<double, most>;

  std::size_t count = 0;
  alignas(64) Each first_x{}, first_y{}, second_x{}, second_y{};

  alignas(64) Each depth{};           ///< [mm] along the first camera's axis; NaN: the rays do not meet before both
  alignas(64) Each x{}, y{}, z{};     ///< [mm] rig frame: on the first ray, where the second one passes nearest
  alignas(64) Each gap_px{};          ///< between the rays, as the second camera sees it at the point's distance
  alignas(64) Each radius_squared{};  ///< of the point's picture in the second camera, in ideal coordinates
  alignas(64) Each pixels_per_mm{};   ///< speed of that picture when the point slides along the first ray
};

/// Where the rays meet. docs/derivations/triangulation.md has the equations.
void intersect(const RayPair& cameras, RayBatch& rays);

}  // namespace pagesweep
