// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "pagesweep/camera/light.h"

namespace pagesweep::sim {

/// The scanner's lamp: a thin bar that sends a sheet of light downwards. The sheet's middle is the rig's light plane;
/// the bar's own width is part of the sheet's profile. Under a translating plane the bar travels along, at a fixed
/// height; about a rotating one it is the axis.
class Lamp {
 public:
  /// \param height_mm  of a travelling bar above the table
  Lamp(Light light, double height_mm, double length_mm);

  double length_mm() const { return length_mm_; }
  /// Direction of the bar.
  const Eigen::Vector3d& along() const { return along_; }
  /// Middle of the bar.
  Eigen::Vector3d middle_at(double time_frames) const;
  /// When the sheet's middle passes a point [frames].
  double time_of(const Eigen::Vector3d& point) const;
  /// How fast the sheet's profile, as wide as it is at the table, passes a point [mm/frame]: the profile is an angular
  /// one and grows with the distance from the bar, so it takes longer to pass below than above the table.
  double speed_at(const Eigen::Vector3d& point) const;

 private:
  Light light_;
  double height_mm_, length_mm_;
  Eigen::Vector3d along_;
  double table_distance_mm_;  ///< from the bar, within the sheet, at right angles to the bar
  double table_speed_mm_;     ///< [mm/frame]
};

}  // namespace pagesweep::sim
