// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <optional>
#include <span>
#include <vector>

#include "pagesweep/base/b_spline.h"

namespace pagesweep {

/// Where the rulings of a page lie as seen from above. With b along the middle ruling and a to its right, both from
/// `origin`, a ruling is the set of points with the same  alpha = a / (1 + fan b).
class RulingFrame {
 public:
  Eigen::Vector2d origin{0, 0};  ///< [mm] plan coordinates (p, q)
  double fan = 0;                ///< [1/mm] 0: parallel rulings; else they meet at b = -1 / fan

  RulingFrame() = default;
  RulingFrame(const Eigen::Vector2d& origin_mm, double angle_rad, double fan_per_mm)
      : origin(origin_mm), fan(fan_per_mm), angle_rad_(angle_rad), across_(std::cos(angle_rad), std::sin(angle_rad)) {}

  /// Of the middle ruling against the q axis, counter-clockwise.
  double angle_rad() const { return angle_rad_; }
  RulingFrame turned(double by_rad) const { return {origin, angle_rad_ + by_rad, fan}; }
  RulingFrame fanned(double by_per_mm) const { return {origin, angle_rad_, fan + by_per_mm}; }
  Eigen::Vector2d across() const { return across_; }
  Eigen::Vector2d along() const { return {-across_.y(), across_.x()}; }
  /// (alpha, b) of a place (p, q)
  Eigen::Vector2d ruling_from_plan(const Eigen::Vector2d& plan) const;
  /// (p, q) of (alpha, b)
  Eigen::Vector2d plan_from_ruling(double alpha, double b) const;

 private:
  double angle_rad_ = 0;
  Eigen::Vector2d across_{1, 0};
};

/// The simplified surface model (paper section IV, step 1): straight rulings, and a cut profile that changes from the
/// lower to the upper page edge:  z(alpha, b) = (1 - tau) f_low(alpha) + tau f_high(alpha),
/// tau = (b - b_low) / (b_high - b_low). Both profiles are cubic splines. Planes, cylinders and cones are of this form.
struct RuledSurface {
  struct Height {
    double z;          ///< [mm]
    double slope;      ///< dz / dalpha
    double curvature;  ///< d2z / dalpha2 [1/mm]
  };

  RulingFrame frame;
  double b_low = 0, b_high = 1;  ///< [mm]
  CubicBSplines splines{{0, 1}};
  Eigen::VectorXd low, high;  ///< [mm] coefficients
  double scatter_mm = 0;      ///< robust scale of the distances of the data

  Height at(double alpha, double b) const;
  /// The point of the surface on ruling alpha at b, plan coordinates.
  Eigen::Vector3d point(double alpha, double b) const;
  double height(const Eigen::Vector2d& plan) const;
  /// Of unit length, up, at the point on ruling alpha at b; plan coordinates.
  Eigen::Vector3d normal(double alpha, double b) const;
};

/// A measured place of the page: the mean of a cell's points.
struct Support {
  Eigen::Vector2d plan;        ///< [mm] (p, q)
  double z;                    ///< [mm]
  double weight;               ///< [1/mm^2]
  Eigen::Matrix2d covariance;  ///< [mm^2] of the points' positions within the cell
};

/// Height of the surface as a cell of finite width sees it: averaged over the cell, to second order.
double height_over(const RuledSurface& surface, const Support& cell);

struct RuledFitOptions {
  std::optional<RulingFrame> gutter;  ///< the gutter is the ruling alpha = 0: origin and angle are fixed by it
  bool search = true;                 ///< for the rulings' direction and fan; else those of `gutter` are kept
  double smoothing = 1;               ///< multiplies the stiffness that generalised cross-validation chooses
};

/// Robust fit (weighted least squares, Cauchy's weights) of a ruled surface, its rulings' direction and fan included.
///
/// The stiffness against bending is chosen by generalised cross-validation (Craven and Wahba 1979). With little data
/// the splines have fewer pieces; in the end a plane remains.
/// \throws Error no_result  if there are fewer than 6 places
RuledSurface fit_ruled_surface(std::span<const Support> cells, const RuledFitOptions& options = {});

}  // namespace pagesweep
