// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "pagesweep/base/image.h"

namespace pagesweep::sim {

/// The point at a height above an unstretched base surface: (s, t, height) [mm] -> rig point.
using Lift = std::function<Eigen::Vector3d(double s_mm, double t_mm, double height_mm)>;

/// Lets paper that was lifted off its base by given heights slide along it until it is stretched as little as possible
/// (in-plane equilibrium of a thin plate, Föppl and von Kármán, with the deflection held). Minimises by Gauss-Newton
///     sum over sides and diagonals pq of ((|X_p - X_q| - l_pq) / l_pq)^2,  X_p = lift(s_p + u_p, t_p + v_p, height_p)
/// where l_pq is the length on the base.
/// \param heights  a node for each pair of parameter lines
/// \param held     whether node (i, j) stays where it is; a whole edge at least, or the sheet slides away
/// \return         (u, v) [mm] a node
Image<Eigen::Vector2d> relax_sheet(const std::vector<double>& s_lines, const std::vector<double>& t_lines,
                                   const Image<double>& heights, const Lift& lift,
                                   const std::function<bool(int i, int j)>& held);

}  // namespace pagesweep::sim
