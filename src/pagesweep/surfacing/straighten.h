// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

namespace pagesweep {

/// How a rectangular sheet lies: the angle by which its sides are turned from x towards y, -45 degrees < angle <= 45
/// degrees, by the smallest rectangle around its places. One of the rectangle's sides lies on a side of the convex hull
/// (Freeman and Shapira 1975).
/// \return [rad] 0 if the places do not fill their rectangle: what is not rectangular has no sides to go by
double askew_rad(std::vector<Eigen::Vector2d> places);

}  // namespace pagesweep
