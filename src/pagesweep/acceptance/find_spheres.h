// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "pagesweep/acceptance/seen_points.h"
#include "pagesweep/acceptance/shapes.h"

namespace pagesweep {

/// Finds spheres of known diameters among everything else, to about a twentieth of their radius.
///
/// A generalised Hough transform: each point votes for the place that is one radius below it along its normal. The
/// votes of a sphere's points meet at its centre, those of other surfaces spread. Each sphere is the place with most
/// votes that is not within a sphere found before.
/// \param diameters_mm  equal ones are found from left to right
/// \return  one sphere a diameter; none at all if one of them is missing
std::vector<Sphere> find_spheres(std::span<const OrientedPoint> points, std::span<const double> diameters_mm);

}  // namespace pagesweep
