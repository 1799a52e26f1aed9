// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

namespace pagesweep::sim {

/// A sheet that was crumpled and smoothed out by hand.
struct Crumple {
  int folds = 0;              ///< 0: not crumpled
  double steepest_rad = 0.5;  ///< no facet is steeper, but for a few in a thousand
  double roughness_mm = 4;    ///< largest standard deviation of its heights
  int seed = 1;               ///< another number, another sheet
};

/// Paper folded again and again by mirrors. A mirror, a plane through the sheet, throws what lies beyond it back to
/// this side: x - 2 max(0, n x - d) n. That leaves the length of every curve on the paper as it is, whatever it was
/// folded into before; so the sheet is isometric by construction. Mirrors are nearly level, so that the paper turns by
/// twice the few degrees between it and the mirror. Where a crease meets the creases of earlier folds, it bends as
/// those of real paper do. Mirrors that would make the sheet too steep or too high are thrown away.
class CrumpledSheet {
 public:
  CrumpledSheet(double width_mm, double height_mm, const Crumple& crumple);

  /// The spot (s, t) of the paper [mm] in a frame with x to the reader's right, y up the page and z up, the origin
  /// being below the middle of the flat sheet and on the level of the lowest spot.
  Eigen::Vector3d at(double s_mm, double t_mm) const;
  int folds() const { return static_cast<int>(folds_.size()); }

 private:
  /// A mirror, and the motion that lays the sheet level after it.
  struct Fold {
    Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
    double distance_mm = 0;
    Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
    Eigen::Vector3d shift = Eigen::Vector3d::Zero();

    Eigen::Vector3d mirrored(const Eigen::Vector3d& x) const;
    Eigen::Vector3d operator*(const Eigen::Vector3d& x) const { return turn * mirrored(x) + shift; }
  };
  static void lay_level(const std::vector<Eigen::Vector3d>& nodes, Fold& fold);

  double width_mm_, height_mm_;
  std::vector<Fold> folds_;
  double lowest_mm_ = 0;
};

}  // namespace pagesweep::sim
