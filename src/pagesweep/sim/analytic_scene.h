// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>

#include "pagesweep/camera/rig.h"
#include "pagesweep/data/correspondences.h"
#include "pagesweep/data/point_map.h"
#include "pagesweep/data/time_map.h"

namespace pagesweep::sim {

/// A surface z = height(x, y) [mm, rig frame] without texture or noise: exact nouns for the tests of single stations,
/// made without rendering a frame. NaN where there is no surface.
struct AnalyticScene {
  std::function<double(double x_mm, double y_mm)> height;
  double highest_mm = 100;  ///< the surface lies between lowest_mm and highest_mm
  double lowest_mm = -20;

  /// First point of the surface along a ray, to 1e-9 mm; nothing if it meets none.
  std::optional<Eigen::Vector3d> meet(const Ray& ray) const;
  /// What a camera would measure: every pixel ok that sees the surface, too_dark otherwise.
  /// \param sigma_mm  put into PointMap::sigma
  PointMap points(const Camera& camera, double sigma_mm = 0.05) const;
  /// The stripe's passing times, with TimeMap::sigma = sigma_frames and amplitude 100; no noise is added.
  TimeMap times(const Camera& camera, const Light& light, double sigma_frames = 0.02) const;
  /// Where `to` sees what each pixel of `from` sees.
  Correspondences correspondences(const Camera& from, const Camera& to) const;
};

/// A rig as in a real scanner: two cameras 640 mm above the table, 400 mm apart along the sweep and turned towards its
/// middle, a sheet of light at right angles to the table, a pushbroom scanner of 300 dpi over an A3 table.
/// \param width_px  of each camera; the height is the same
Rig make_test_rig(int width_px = 256);

}  // namespace pagesweep::sim
