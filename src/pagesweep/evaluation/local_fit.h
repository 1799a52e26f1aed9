// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string_view>

#include "pagesweep/data/point_map.h"

namespace pagesweep {

/// What a local fit is: a flat patch has less noise, a curved one follows a curved page.
enum class LocalFit { plane, quadric };
constexpr auto names_of(LocalFit) { return std::array<std::string_view, 2>{"plane", "quadric"}; }

/// Where the viewing ray of pixel (x, y) meets a surface that is fitted to the measured points around it, without
/// looking at the truth: height along the ray as a polynomial of the place across it, weighted with the claimed
/// standard deviations and robust (Tukey's weights about the median residual size).
/// \param diameter_mm  of the neighbourhood, across the ray
/// \return  [mm] rig frame; nothing if there are fewer than twice as many points as the fit has unknowns, or if they
///          surround the pixel on one side only
/// \pre     the pixel's own point is measured
std::optional<Eigen::Vector3d> fit_locally(const PointMap& points, int x, int y, const Eigen::Vector3d& camera_center,
                                           double diameter_mm, LocalFit model);

}  // namespace pagesweep
