// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string_view>

#include "pagesweep/base/enum_names.h"
#include "pagesweep/sim/grid_mesh.h"

namespace pagesweep::sim {

enum class ObstacleKind {
  finger,  ///< a cylinder with a round end that lies on the paper and rises outwards
  slip,    ///< a piece of blank paper above the page, bent as the page is
};
constexpr auto names_of(ObstacleKind) { return std::array<std::string_view, 2>{"finger", "slip"}; }

/// Something that lies on a page and hides print.
struct Obstacle {
  ObstacleKind kind = ObstacleKind::finger;
  int page = 1;               ///< on which it lies
  double s_mm = 0, t_mm = 0;  ///< of the finger's end, of the slip's middle, on the page
  double turn_rad = 0;     ///< on the paper: 0 is towards the reader's right (the finger comes from there), pi/2 down
  double length_mm = 70;   ///< of the finger; of the slip along its direction
  double breadth_mm = 16;  ///< diameter of the finger; of the slip across its direction
  double lift_mm = 1;      ///< of the slip's middle above the paper; its ends rise to twice as much
  double albedo = 0.5;
};

/// \param page  the sheet on which it lies
GridMesh make_obstacle(const Obstacle& obstacle, const GridMesh& page, double spacing_mm);

}  // namespace pagesweep::sim
