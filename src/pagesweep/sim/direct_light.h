// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "pagesweep/sim/world.h"

namespace pagesweep::sim {

inline constexpr int most_viewers = 2;

/// The lamp's light at a node of a mesh. Light is relative: 1 is what the stripe's middle gives to a level white spot
/// at the table's origin.
struct NodeLight {
  float time = 0;                  ///< [frames] when the stripe's middle passes
  float speed = 0;                 ///< [mm/frame] of the stripe's profile, see Lamp::speed_at()
  float diffuse = 0;               ///< irradiance at that time
  float gloss[most_viewers] = {};  ///< mirrored towards each viewer then: the albedo's equivalent times irradiance
};

/// The lamp's light on every surface: per surface one NodeLight a node, in the mesh's order.
using DirectLight = std::vector<std::vector<NodeLight>>;

/// Irradiance = integral along the bar of visibility * cos(incidence) * cos(emission) / distance^2, at the moment at
/// which the sheet's middle passes the node. The sheet is thin, so direction and shadow are those of that moment
/// throughout.
/// \param viewers  positions [mm] towards which gloss is computed; at most most_viewers
/// \param samples  of the bar's length, evenly spaced
DirectLight light_surfaces(const World& world, const RayCaster& caster, const Lamp& lamp,
                           std::span<const Eigen::Vector3d> viewers, int samples);

/// Irradiance at a level spot that nothing shades, relative to the table's origin.
double open_irradiance(const Lamp& lamp, const Eigen::Vector3d& point);

/// A NodeLight at a spot, by the spot's weights.
NodeLight light_at(const std::vector<NodeLight>& nodes, const MeshSpot& spot);

/// A place just above a surface for rays to start from, and the surface's unit normal. It keeps clear of the surface's
/// own edges, where another one may touch it.
struct Outpost {
  Eigen::Vector3d point;
  Eigen::Vector3d normal;
};
Outpost outpost_at(const GridMesh& mesh, double s_mm, double t_mm);

}  // namespace pagesweep::sim
