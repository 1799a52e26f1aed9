// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>

#include "pagesweep/sim/grid_mesh.h"
#include "pagesweep/sim/lamp.h"
#include "pagesweep/sim/ray_caster.h"
#include "pagesweep/sim/stripe.h"
#include "pagesweep/sim/texture.h"

namespace pagesweep::sim {

/// Reflection at the surface, beside the paper's own: a normalised Blinn-Phong lobe.
struct Gloss {
  double strength = 0;   ///< share of light that is mirrored at normal incidence
  double exponent = 60;  ///< the higher the sharper
};

/// One thing that light meets.
struct Surface {
  GridMesh mesh;
  Texture albedo = {};
  Gloss gloss = {};
  bool is_measured = false;  ///< belongs to what a scan is about; else to table and book block
  int page = 0;              ///< 1, 2, ... for a page; 0 for anything else
};

/// All that stands still during a sweep.
struct World {
  std::deque<Surface> surfaces;  ///< a deque, because the ray caster refers to the meshes

  RayCaster make_ray_caster() const {
    std::vector<const GridMesh*> meshes;
    for (const Surface& surface : surfaces) meshes.push_back(&surface.mesh);
    return RayCaster(std::move(meshes));
  }
};

}  // namespace pagesweep::sim
