// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/epipolar_curve.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include "pagesweep/camera/valid_radius.h"

namespace pagesweep {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// Narrows `range` to where c0 + w c1 >= 0.
void keep_where_positive(double c0, double c1, InverseDepthRange& range) {
  if (c1 > 0) {
    range.far = std::max(range.far, -c0 / c1);
  } else if (c1 < 0) {
    range.near = std::min(range.near, -c0 / c1);
  } else if (c0 < 0) {
    range.near = range.far;
  }
}

}  // namespace

View::View(const RayTable& rays)
    : lens_(rays.camera().distortion),
      fx_(rays.camera().fx),
      fy_(rays.camera().fy),
      cx_(rays.camera().cx),
      cy_(rays.camera().cy),
      max_u_(rays.width() - 0.5),
      max_v_(rays.height() - 0.5),
      max_radius_squared_(largest_valid_radius_squared(lens_)),
      lowest_(Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity())),
      highest_(-lowest_) {
  for (int y = 0; y < rays.height(); ++y)
    for (int x = 0; x < rays.width(); ++x) {
      const Eigen::Vector2d& direction = rays.direction(x, y);
      if (!(direction.x() == direction.x())) continue;
      lowest_ = lowest_.cwiseMin(direction);
      highest_ = highest_.cwiseMax(direction);
    }
  const Eigen::Vector2d border(2 / fx_, 2 / fy_);  // the outer half pixel, and room for its bending
  lowest_ -= border;
  highest_ += border;
}

std::optional<CurveTangent> View::locate(const Eigen::Vector3d& point, const Eigen::Vector3d& change) const {
  if (!(point.z() > 0)) return std::nullopt;
  const double scale = 1 / point.z(), x = scale * point.x(), y = scale * point.y();
  const double dx = scale * (change.x() - x * change.z()), dy = scale * (change.y() - y * change.z());
  const double r2 = x * x + y * y, half_dr2 = x * dx + y * dy, dxy = x * dy + y * dx;
  if (!(r2 <= max_radius_squared_)) return std::nullopt;
  const double radial = 1 + r2 * (lens_.k1 + r2 * (lens_.k2 + r2 * lens_.k3));
  const double dradial = 2 * half_dr2 * (lens_.k1 + r2 * (2 * lens_.k2 + r2 * 3 * lens_.k3));
  const double u = fx_ * (x * radial + 2 * lens_.p1 * x * y + lens_.p2 * (r2 + 2 * x * x)) + cx_;
  const double v = fy_ * (y * radial + lens_.p1 * (r2 + 2 * y * y) + 2 * lens_.p2 * x * y) + cy_;
  if (!(u >= -0.5 && v >= -0.5 && u <= max_u_ && v <= max_v_)) return std::nullopt;
  const double du = dx * radial + x * dradial + 2 * (lens_.p1 * dxy + lens_.p2 * (half_dr2 + 2 * x * dx));
  const double dv = dy * radial + y * dradial + 2 * (lens_.p1 * (half_dr2 + 2 * y * dy) + lens_.p2 * dxy);
  return CurveTangent{{u, v}, {fx_ * du, fy_ * dv}};
}

LensNumbers View::lens() const {
  const auto f = [](double value) { return static_cast<float>(value); };
  return {f(fx_),      f(fy_),      f(cx_),      f(cy_),      f(lens_.k1),
          f(lens_.k2), f(lens_.k3), f(lens_.p1), f(lens_.p2), f(max_radius_squared_)};
}

InverseDepthRange View::clip(const Eigen::Vector3d& a, const Eigen::Vector3d& b, InverseDepthRange range) const {
  // In front of the camera, x/z >= lowest is x - lowest z >= 0: linear in w.
  keep_where_positive(a.z() - 1e-9, b.z(), range);
  for (int i = 0; i < 2; ++i) {
    keep_where_positive(a[i] - lowest_[i] * a.z(), b[i] - lowest_[i] * b.z(), range);
    keep_where_positive(highest_[i] * a.z() - a[i], highest_[i] * b.z() - b[i], range);
  }
  return range;
}

void CurveSamples::clear() {
  u.clear();
  v.clear();
  inverse_depth.clear();
}

void CurveSamples::add(double w, const Eigen::Vector2d& pixel) {
  u.push_back(static_cast<float>(pixel.x()));
  v.push_back(static_cast<float>(pixel.y()));
  inverse_depth.push_back(w);
}

void sample(const EpipolarCurve& curve, CurveSamples& samples) {
  constexpr int stride_px = 8;           // a real lens bends the curve by less than 0.01 px within it
  constexpr int longest_curve = 200000;  // beside the epipole a curve can be endless
  const auto place = [&](double w) { return curve.at(w).value_or(Eigen::Vector2d(nan, nan)); };
  samples.clear();
  if (curve.range().empty()) return;
  double w = curve.range().far;
  Eigen::Vector2d pixel = place(w);
  samples.add(w, pixel);
  while (w < curve.range().near && samples.size() < longest_curve) {
    const double next_w = std::min(w + stride_px / std::max(curve.speed(w), 1e-9), curve.range().near);
    const Eigen::Vector2d next = place(next_w);
    const double length = (next - pixel).norm();
    const bool seen = length < 100 * stride_px;  // false where either end is not
    const int steps = seen ? std::max(1, static_cast<int>(std::ceil(length))) : stride_px;
    for (int i = 1; i < steps; ++i) {
      const double share = static_cast<double>(i) / steps, between = w + share * (next_w - w);
      samples.add(between, seen ? Eigen::Vector2d(pixel + share * (next - pixel)) : place(between));
    }
    samples.add(next_w, next);
    w = next_w;
    pixel = next;
  }
}

EpipolarGeometry::EpipolarGeometry(const RayTable& from, const RayTable& to, InverseDepthRange range)
    : from_rays_(&from),
      to_rays_(&to),
      view_(to),
      to_from_from_(to.camera().cam_from_rig * from.camera().cam_from_rig.inverse()),
      range_(range) {}

EpipolarCurve EpipolarGeometry::curve(int x, int y) const {
  const Eigen::Vector3d a = direction(x, y);
  if (!a.allFinite()) return {view_, Eigen::Vector3d(0, 0, -1), Eigen::Vector3d::Zero(), {0, 0}};
  return {view_, a, origin(), range_};
}

}  // namespace pagesweep
