// SPDX-License-Identifier: Apache-2.0
#pragma once

// What the models of docs/formats.md see, written for numbers that carry their derivatives (Ceres' jets). A test
// compares them with camera/.

#include <ceres/rotation.h>

#include <Eigen/Core>
#include <cmath>

#include "pagesweep/calibration/bundle.h"

namespace pagesweep::projection {

template <class T>
using Vector2 = Eigen::Matrix<T, 2, 1>;
template <class T>
using Vector3 = Eigen::Matrix<T, 3, 1>;

/// A sensor's view of a rig point: R exp([turn]x) (X - center), pose = (turn, center).
template <class T>
Vector3<T> turned(const Eigen::Matrix3d& rotation, const T* pose, const Vector3<T>& vector) {
  Vector3<T> result;
  ceres::AngleAxisRotatePoint(pose, vector.data(), result.data());
  return rotation.cast<T>() * result;
}

template <class T>
Vector3<T> from_center(const T* pose, const Vector3<T>& point) {
  return point - Vector3<T>(pose[3], pose[4], pose[5]);
}

/// Parameters fx, fy, cx, cy, k1, k2, p1, p2, k3.
struct FrameCamera {
  static constexpr int inside = 9;
  Eigen::Matrix3d rotation;

  template <class T>
  bool operator()(const T* in, const T* pose, const Vector3<T>& point, Vector2<T>& pixel) const {
    const Vector3<T> p = turned(rotation, pose, from_center(pose, point));
    if (!(p.z() > 1e-6)) return false;
    const T x = p.x() / p.z(), y = p.y() / p.z(), r2 = x * x + y * y;
    const T radial = 1.0 + r2 * (in[4] + r2 * (in[5] + r2 * in[8]));
    pixel.x() = in[0] * (x * radial + 2.0 * in[6] * x * y + in[7] * (r2 + 2.0 * x * x)) + in[2];
    pixel.y() = in[1] * (y * radial + in[6] * (r2 + 2.0 * y * y) + 2.0 * in[7] * x * y) + in[3];
    return true;
  }
};

/// Parameters f, cx, k1, step along x, y, z.
struct PushbroomLine {
  static constexpr int inside = 6;
  Eigen::Matrix3d rotation;

  template <class T>
  bool operator()(const T* in, const T* pose, const Vector3<T>& point, Vector2<T>& pixel) const {
    const Vector3<T> q = turned(rotation, pose, from_center(pose, point));
    const Vector3<T> step = turned(rotation, pose, Vector3<T>(in[3], in[4], in[5]));
    const T row = q.y() / step.y();
    const T depth = q.z() - row * step.z();
    if (!(depth > 1e-6)) return false;
    const T x = (q.x() - row * step.x()) / depth;
    pixel = {in[0] * x * (1.0 + in[2] * x * x) + in[1], row};
    return true;
  }
};

/// Parameters f, cx, k1, angle_step. angle0 says nothing that a turn about the camera's x axis does not, and is held.
struct TurningLine {
  static constexpr int inside = 4;
  Eigen::Matrix3d rotation;
  double angle0 = 0;

  template <class T>
  bool operator()(const T* in, const T* pose, const Vector3<T>& point, Vector2<T>& pixel) const {
    using std::atan2, std::sqrt;
    const Vector3<T> p = turned(rotation, pose, from_center(pose, point));
    const T depth2 = p.y() * p.y() + p.z() * p.z();
    if (!(depth2 > 1e-12)) return false;
    const T x = p.x() / sqrt(depth2);
    pixel = {in[0] * x * (1.0 + in[2] * x * x) + in[1], (atan2(p.y(), p.z()) - angle0) / in[3]};
    return true;
  }
};

/// A place on a board in the board frame, see BoardShape. shape = (stretch, bend...).
template <class T>
Vector3<T> board_point(const Eigen::Vector2d& place, const Eigen::Vector2d& size, const T* shape) {
  const double x = 2 * place.x() / size.x() - 1, y = 2 * place.y() / size.y() - 1;
  const double px[5] = {1, x, 1.5 * x * x - 0.5, 2.5 * x * x * x - 1.5 * x, (35 * x * x * x * x - 30 * x * x + 3) / 8};
  const double py[5] = {1, y, 1.5 * y * y - 0.5, 2.5 * y * y * y - 1.5 * y, (35 * y * y * y * y - 30 * y * y + 3) / 8};
  T z(0);
  int k = 0;
  for (int degree = 2; degree <= 4; ++degree)
    for (int m = 0; m <= degree; ++m) z += shape[1 + k++] * (px[m] * py[degree - m]);
  const Eigen::Vector2d from_middle = place - 0.5 * size;
  return {0.5 * size.x() + from_middle.x() * (1.0 - 0.5 * shape[0]),
          0.5 * size.y() + from_middle.y() * (1.0 + 0.5 * shape[0]), z};
}

/// Where a board's corner is seen. The middle of a circle's picture is not the picture of its middle: to second order
/// it lies twice as far off it as the mean of four points of the rim does.
template <class Projection, class T, class S>
bool corner_pixel(const Projection& project, const Board& board, int corner, const T* inside, const T* pose,
                  const T* rig_from_board, const S* shape, Vector2<T>& pixel) {
  const Eigen::Vector2d place = board.corner_mm(corner), size = board.size_mm();
  const auto see = [&](const Eigen::Vector2d& at, Vector2<T>& image) {
    const Vector3<T> on_board = board_point(at, size, shape).template cast<T>();
    Vector3<T> turned_point;
    ceres::AngleAxisRotatePoint(rig_from_board, on_board.data(), turned_point.data());
    const Vector3<T> in_rig = turned_point + Vector3<T>(rig_from_board[3], rig_from_board[4], rig_from_board[5]);
    return project(inside, pose, in_rig, image);
  };
  if (!see(place, pixel)) return false;
  if (board.type != BoardType::circles) return true;
  const Eigen::Vector2d radius = 0.5 * board.marker_mm * board.print_scale;
  Vector2<T> mean = Vector2<T>::Zero(), rim;
  for (const Eigen::Vector2d& way :
       {Eigen::Vector2d(1, 0), Eigen::Vector2d(-1, 0), Eigen::Vector2d(0, 1), Eigen::Vector2d(0, -1)}) {
    if (!see(place + way.cwiseProduct(radius), rim)) return false;
    mean += 0.25 * rim;
  }
  pixel = 2.0 * mean - pixel;
  return true;
}

}  // namespace pagesweep::projection
