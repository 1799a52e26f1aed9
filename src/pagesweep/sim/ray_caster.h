// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>
#include <vector>

#include "pagesweep/sim/grid_mesh.h"

namespace pagesweep::sim {

struct SimRay {
  Eigen::Vector3f origin;     ///< [mm]
  Eigen::Vector3f direction;  ///< any length
};

struct SimHit {
  int surface = -1;  ///< -1: the ray meets nothing
  MeshSpot spot;
};

/// Finds what rays meet first, with Embree. The meshes must outlive it.
class RayCaster {
 public:
  explicit RayCaster(std::vector<const GridMesh*> surfaces);
  ~RayCaster();
  RayCaster(RayCaster&&) noexcept;

  /// \param rays  fastest if they are neighbours
  void cast(std::span<const SimRay> rays, std::span<SimHit> hits) const;
  SimHit cast(const SimRay& ray) const;
  /// Whether something lies between two points, both excluded.
  bool blocked(const Eigen::Vector3f& from, const Eigen::Vector3f& to) const;

 private:
  struct Embree;
  std::vector<const GridMesh*> surfaces_;
  std::unique_ptr<Embree> embree_;
};

}  // namespace pagesweep::sim
