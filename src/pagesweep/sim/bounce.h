// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <span>
#include <vector>

#include "pagesweep/sim/direct_light.h"

namespace pagesweep::sim {

struct BounceOptions {
  double spacing_mm = 2.5;  ///< of the receiving places on what is measured; elsewhere six times as much
  int rays = 512;           ///< that each of them sends out
};

/// Light that comes by way of one diffuse reflection elsewhere: at places a few millimetres apart on every surface, its
/// irradiance at each frame. It is gathered with cosine-distributed rays, so the form factors to all that the place
/// sees sum to at most 1, with visibility and without singularities where pages touch.
class Bounce {
 public:
  Bounce(const World& world, const RayCaster& caster, const DirectLight& direct, const Stripe& stripe, int frames,
         const BounceOptions& options);

  int frames() const { return frames_; }
  /// Adds weight * irradiance at (s, t) of a surface to each frame.
  void add(int surface, float s_mm, float t_mm, float weight, std::span<float> frames) const;
  /// Irradiance at a moment; constant before the first and after the last frame.
  float at(int surface, float s_mm, float t_mm, float time_frames) const;

 private:
  struct Receivers {
    float s_spacing = 1, t_spacing = 1;  ///< [mm]
    int columns = 0, rows = 0;
    std::vector<float> irradiance;  ///< frames() values a place
  };
  struct Corner {
    const float* frames;
    float weight;
  };
  std::array<Corner, 4> corners(int surface, float s_mm, float t_mm) const;

  int frames_;
  std::vector<Receivers> receivers_;
};

/// Adds weight * the stripe's light at each frame to `frames`, as it passes a spot.
void add_stripe(const Stripe& stripe, const NodeLight& light, float weight, std::span<float> frames);

/// `count` directions about +z, evenly distributed with density cosine / pi: a Fibonacci spiral lifted to the
/// hemisphere.
std::vector<Eigen::Vector3d> cosine_directions(int count);

}  // namespace pagesweep::sim
