// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <optional>
#include <vector>

#include "pagesweep/camera/camera.h"
#include "pagesweep/camera/ray_table.h"
#include "pagesweep/matching/follow_curves.h"

namespace pagesweep {

/// Depths are inverse distances along the optical axis of the camera that the pixel belongs to [1/mm]: the picture of a
/// point moves almost evenly with them, and infinity is 0.
struct InverseDepthRange {
  double far = 0;
  double near = 0;
  bool empty() const { return !(far < near); }
};

/// A place of a curve, and its direction.
struct CurveTangent {
  Eigen::Vector2d pixel;   ///< [px]
  Eigen::Vector2d change;  ///< [px mm] a unit of inverse depth
};

/// A camera that is looked into, made ready to project a million points.
class View {
 public:
  explicit View(const RayTable& camera);

  /// Where a point of the camera's frame is imaged; nothing if the picture does not show it.
  std::optional<Eigen::Vector2d> locate(const Eigen::Vector3d& point) const {
    if (!(point.z() > 0)) return std::nullopt;
    const double scale = 1 / point.z();
    const double x = scale * point.x(), y = scale * point.y(), r2 = x * x + y * y;
    if (!(r2 <= max_radius_squared_)) return std::nullopt;
    const double radial = 1 + r2 * (lens_.k1 + r2 * (lens_.k2 + r2 * lens_.k3));
    const double u = fx_ * (x * radial + 2 * lens_.p1 * x * y + lens_.p2 * (r2 + 2 * x * x)) + cx_;
    const double v = fy_ * (y * radial + lens_.p1 * (r2 + 2 * y * y) + 2 * lens_.p2 * x * y) + cy_;
    if (!(u >= -0.5 && v >= -0.5 && u <= max_u_ && v <= max_v_)) return std::nullopt;
    return Eigen::Vector2d(u, v);
  }

  /// The same, and how the picture moves when the point moves by `change`.
  std::optional<CurveTangent> locate(const Eigen::Vector3d& point, const Eigen::Vector3d& change) const;

  double focal_length_px() const { return fx_; }
  LensNumbers lens() const;
  /// [ideal coordinates] of what the picture shows, and little more.
  const Eigen::Vector2d& lowest() const { return lowest_; }
  const Eigen::Vector2d& highest() const { return highest_; }
  /// Part of the line a + w b (homogeneous, w in `range`) that can be in the picture: all that is seen and little more.
  InverseDepthRange clip(const Eigen::Vector3d& a, const Eigen::Vector3d& b, InverseDepthRange range) const;

 private:
  BrownConrady lens_;
  double fx_, fy_, cx_, cy_, max_u_, max_v_;
  double max_radius_squared_;         ///< of ideal coordinates: where the distortion model ends
  Eigen::Vector2d lowest_, highest_;  ///< ideal coordinates of the picture's bounding box
};

/// The true epipolar curve of one pixel: where another camera sees the points of its viewing ray. A point at inverse
/// depth w is imaged as a + w b in the other camera, the straight line of an ideal lens, which its distortion bends.
class EpipolarCurve {
 public:
  /// \param a  the pixel's direction (X/Z, Y/Z, 1), turned into the other camera's frame
  /// \param b  the pixel's camera's centre in the other camera's frame [mm]
  EpipolarCurve(const View& view, const Eigen::Vector3d& a, const Eigen::Vector3d& b, InverseDepthRange range)
      : view_(&view), a_(a), b_(b), range_(view.clip(a, b, range)) {}

  /// Empty if no point within the depth range can be seen. Single points of the range may still be unseen.
  const InverseDepthRange& range() const { return range_; }
  bool contains(double inverse_depth) const { return inverse_depth >= range_.far && inverse_depth <= range_.near; }
  const Eigen::Vector3d& direction() const { return a_; }
  const Eigen::Vector3d& origin() const { return b_; }
  const View& view() const { return *view_; }
  /// [px] in the other picture; nothing if it does not show that point.
  std::optional<Eigen::Vector2d> at(double inverse_depth) const { return view_->locate(a_ + inverse_depth * b_); }
  std::optional<CurveTangent> tangent(double inverse_depth) const { return view_->locate(a_ + inverse_depth * b_, b_); }
  /// Pixels a unit of inverse depth [px mm], the lens taken as ideal: for the choice of steps.
  double speed(double inverse_depth) const {
    const Eigen::Vector3d p = a_ + inverse_depth * b_;
    const double du = b_.x() * p.z() - p.x() * b_.z(), dv = b_.y() * p.z() - p.y() * b_.z();
    return view_->focal_length_px() * std::sqrt(du * du + dv * dv) / (p.z() * p.z());
  }

 private:
  const View* view_;
  Eigen::Vector3d a_, b_;
  InverseDepthRange range_;
};

/// Places about a pixel apart along a curve, from far to near. A place that is not seen has u = v = NaN.
struct CurveSamples {
  std::vector<float> u, v;            ///< [px]; within 0.01 px of the curve
  std::vector<double> inverse_depth;  ///< [1/mm]
  int size() const { return static_cast<int>(u.size()); }
  void clear();
  void add(double w, const Eigen::Vector2d& pixel);
};

/// Refills `samples`; the result's memory is reused from curve to curve.
void sample(const EpipolarCurve& curve, CurveSamples& samples);

/// All epipolar curves of one camera in another.
class EpipolarGeometry {
 public:
  /// The cameras must outlive this.
  /// \param range  of depths in `from`
  EpipolarGeometry(const RayTable& from, const RayTable& to, InverseDepthRange range);
  /// The same for another range.
  EpipolarGeometry within(InverseDepthRange range) const {
    EpipolarGeometry geometry = *this;
    geometry.range_ = range;
    return geometry;
  }
  const RayTable& from() const { return *from_rays_; }
  const RayTable& to() const { return *to_rays_; }
  EpipolarCurve curve(int x, int y) const;
  /// A pixel's direction (X/Z, Y/Z, 1), turned into the other camera's frame; NaN where the distortion has no inverse.
  Eigen::Vector3d direction(int x, int y) const {
    return to_from_from_.rotation * from_rays_->direction(x, y).homogeneous();
  }
  const Eigen::Vector2d& ray(int x, int y) const {
    return from_rays_->direction(x, y);
  }  ///< (X/Z, Y/Z) in its own frame
  const Eigen::Matrix3d& rotation() const { return to_from_from_.rotation; }   ///< into the other camera's
  const Eigen::Vector3d& origin() const { return to_from_from_.translation; }  ///< of all rays [mm] in that frame
  const View& view() const { return view_; }
  const InverseDepthRange& range() const { return range_; }

 private:
  const RayTable *from_rays_, *to_rays_;
  View view_;
  Rigid3 to_from_from_;
  InverseDepthRange range_;
};

}  // namespace pagesweep
