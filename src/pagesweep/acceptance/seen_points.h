// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "pagesweep/camera/camera.h"
#include "pagesweep/data/point_map.h"

namespace pagesweep {

/// One placement of the artefact in front of the instrument, as measured.
struct ArtefactPose {
  std::string name;
  std::vector<Camera> cameras;
  std::vector<PointMap> points;  ///< one a camera
};

/// A measured point and the camera that it was seen from.
struct SeenPoint {
  Eigen::Vector3d position;  ///< [mm] rig frame
  Eigen::Vector3d eye;       ///< [mm] the camera's centre
  double sigma_mm;           ///< claimed standard deviation along the viewing ray; NaN: nothing is claimed

  Ray ray() const { return {eye, (position - eye).normalized()}; }
};

/// All points with status ok, camera by camera.
/// \throws std::invalid_argument  if cameras and maps do not belong together
std::vector<SeenPoint> seen_points_of(const ArtefactPose& pose);

/// A point with the normal of the surface around it.
struct OrientedPoint {
  Eigen::Vector3d position;  ///< [mm] rig frame
  Eigen::Vector3d normal;    ///< towards the camera
};

/// Normals from planes through the points within about `patch_mm` of every so-many-th pixel, at most about
/// `most_points` of them a camera.
std::vector<OrientedPoint> oriented_points_of(const ArtefactPose& pose, double patch_mm, int most_points);

}  // namespace pagesweep
