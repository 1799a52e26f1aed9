// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "pagesweep/camera/light.h"

namespace pagesweep {

/// Where a viewing ray meets the sheet of light as it stood at some time.
struct LightSection {
  double distance_mm = 0;   ///< along the ray; not positive or finite if it does not meet the sheet in front
  double mm_per_frame = 0;  ///< speed of the meeting point along the ray
};

LightSection section(const Light& light, const Ray& ray, double time_frames);

/// A moving sheet of light that a million viewing rays of one centre are asked for. Recorded planes are met in closed
/// form: docs/derivations/fusion.md.
class SeenLight {
 public:
  /// \param light  outlives this
  SeenLight(const Light& light, const Eigen::Vector3d& center);

  /// \param direction  of a ray from the centre, unit length
  LightSection section(const Eigen::Vector3d& direction, double time_frames) const;
  /// Light::time_of(), found at once where it is about `expected`.
  std::optional<double> time_of(const Eigen::Vector3d& rig_point, double expected) const;

 private:
  const Light& light_;
  Eigen::Vector3d center_;
  const RecordedPlanes* recorded_;      ///< null: another model
  std::vector<double> from_center_mm_;  ///< distance of the centre from each recorded plane
};

}  // namespace pagesweep
