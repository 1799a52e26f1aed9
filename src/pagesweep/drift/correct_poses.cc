// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/drift/correct_poses.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "pagesweep/base/error.h"

namespace pagesweep {
namespace {

constexpr double radians_a_degree = std::numbers::pi / 180;
constexpr double pixel_sigma_px = 0.03;  // of a tie point's place in the first camera: what smoothing leaves
constexpr double scan_floor_px = 0.2;    // [scan pixels] of a place in the scan, whatever its covariance
constexpr int least_ties = 20;

// Unknowns beside the points: turn [rad] and shift [mm] of each camera in its own frame, then the light's start [mm]
// and speed [part of it].
constexpr int pose_size = 6, light_begin = 2 * pose_size, unknowns = light_begin + 2;
using Common = Eigen::Matrix<double, unknowns, 1>;
using CommonSquare = Eigen::Matrix<double, unknowns, unknowns>;
using CommonByPoint = Eigen::Matrix<double, unknowns, 3>;

Eigen::Matrix3d cross(const Eigen::Vector3d& v) {
  Eigen::Matrix3d matrix;
  matrix << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return matrix;
}

Eigen::Matrix3d rotation_by(const Eigen::Vector3d& turn) {
  const double angle = turn.norm();
  return angle > 0 ? Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix() : Eigen::Matrix3d::Identity();
}

/// One scalar observation: what it misses, over its standard deviation, and how that changes.
struct Row {
  double miss;
  Common by_common = Common::Zero();
  Eigen::Vector3d by_point = Eigen::Vector3d::Zero();
};

/// Everything that is seen of one tie point.
class Observations {
 public:
  std::vector<Row> rows;

  /// \param weight  square root of the inverse covariance
  template <class ByCommon>
  void add(const Eigen::Vector2d& miss, const Eigen::Matrix2d& weight, const Matrix23d& by_point,
           const ByCommon& by_common, int first_unknown) {
    const Eigen::Vector2d weighted = weight * miss;
    const Matrix23d point = weight * by_point;
    for (int i = 0; i < 2; ++i) {
      Row row{weighted(i)};
      row.by_point = point.row(i);
      row.by_common.segment(first_unknown, by_common.cols()) = (weight * by_common).row(i);
      rows.push_back(row);
    }
  }
};

Eigen::Matrix2d weight_of(const Eigen::Matrix2d& covariance) {
  return Eigen::LLT<Eigen::Matrix2d>(covariance.inverse()).matrixL().transpose();
}

class Adjustment {
 public:
  Adjustment(std::span<const TiePoint> ties, const Camera& first, const Camera& second, const Rig& rig,
             const DriftPriors& priors)
      : ties_(ties), cameras_{first, second}, rig_(rig), priors_(priors) {
    for (const TiePoint& tie : ties) points_.push_back(tie.point);
    std::vector<double> times;
    for (const TiePoint& tie : ties) times.push_back(tie.time);
    const auto middle = times.begin() + static_cast<std::ptrdiff_t>(times.size() / 2);
    std::nth_element(times.begin(), middle, times.end());
    middle_time_ = *middle;
  }

  /// First by Huber's weights, from however far; then by Tukey's, which forget what does not belong.
  void run() {
    constexpr int steps = 8;
    for (int i = 0; i < steps; ++i) step([](double miss) { return std::min(1.0, 2 / std::max(miss, 1e-9)); });
    for (int i = 0; i < steps; ++i)
      step([](double miss) { return miss < 5 ? std::pow(1 - miss * miss / 25, 2) : 0.0; });
  }

  PoseCorrection describe(const Camera& first, const Camera& second) const {
    PoseCorrection result;
    const std::array<const Camera*, 2> before{&first, &second};
    for (std::size_t c = 0; c < 2; ++c) {
      CameraDrift& drift = result.cameras[c];
      drift.camera = cameras_[c];
      const Eigen::Matrix3d turned = cameras_[c].cam_from_rig.rotation * before[c]->cam_from_rig.rotation.transpose();
      drift.turn_deg = Eigen::AngleAxisd(turned).angle() / radians_a_degree;
      drift.shift_mm = (cameras_[c].center() - before[c]->center()).norm();
      const auto variance = covariance_.diagonal().segment<pose_size>(static_cast<int>(c) * pose_size);
      drift.turn_sigma_deg = std::sqrt(variance.head<3>().sum()) / radians_a_degree;
      drift.shift_sigma_mm = std::sqrt(variance.tail<3>().sum());
    }
    double moved = 0, squares = 0, rows = 0;
    for (std::size_t i = 0; i < ties_.size(); ++i) {
      moved += (points_[i] - ties_[i].point).squaredNorm();
      const Observations seen = observe(i);
      bool is_used = true;
      for (const Row& row : seen.rows) is_used = is_used && std::abs(row.miss) < outlier;
      if (!is_used) continue;
      ++result.used;
      for (const Row& row : seen.rows) squares += row.miss * row.miss;
      rows += static_cast<double>(seen.rows.size()) - 3;
    }
    result.moved_rms_mm = std::sqrt(moved / static_cast<double>(ties_.size()));
    result.misfit = std::sqrt(squares / std::max(1.0, rows - unknowns));
    return result;
  }

 private:
  static constexpr double outlier = 4;  // standard deviations

  void observe_camera(std::size_t c, const Eigen::Vector3d& point, const Eigen::Vector2d& pixel,
                      const Eigen::Matrix2d& covariance, Observations& seen) const {
    const Camera& camera = cameras_[c];
    const auto expected = camera.project(point);
    if (!expected) return;
    const Matrix23d by_point = camera.project_jacobian(point);
    const Eigen::Vector3d in_camera = camera.cam_from_rig * point;
    // A camera that turns by w and moves by -v sees its points move by w x X + v.
    Eigen::Matrix<double, 3, pose_size> by_pose;
    by_pose << -cross(in_camera), Eigen::Matrix3d::Identity();
    const Eigen::Matrix<double, 2, pose_size> jacobian = by_point * camera.cam_from_rig.rotation.transpose() * by_pose;
    seen.add(*expected - pixel, weight_of(covariance), by_point, jacobian, static_cast<int>(c) * pose_size);
  }

  void observe_light(const TiePoint& tie, const Eigen::Vector3d& point, Observations& seen) const {
    const Plane plane = rig_.light->plane_at(tie.time);
    const double speed = plane.distance(point) - rig_.light->plane_at(tie.time + 1).distance(point);  // [mm/frame]
    const double way = (tie.time - middle_time_) * speed;
    Row row{(plane.distance(point) - light_(0) - way * light_(1)) / priors_.light_mm};
    row.by_point = plane.normal / priors_.light_mm;
    row.by_common(light_begin) = -1 / priors_.light_mm;
    row.by_common(light_begin + 1) = -way / priors_.light_mm;
    seen.rows.push_back(row);
  }

  Observations observe(std::size_t i) const {
    const TiePoint& tie = ties_[i];
    Observations seen;
    const double variance = pixel_sigma_px * pixel_sigma_px;
    observe_camera(0, points_[i], tie.first, variance * Eigen::Matrix2d::Identity(), seen);
    observe_camera(1, points_[i], tie.second, tie.second_covariance + variance * Eigen::Matrix2d::Identity(), seen);
    if (tie.scan)
      if (const auto expected = rig_.scanner->project(points_[i])) {
        const Eigen::Matrix2d covariance =
            tie.scan->covariance + scan_floor_px * scan_floor_px * Eigen::Matrix2d::Identity();
        seen.add(*expected - tie.scan->place, weight_of(covariance), rig_.scanner->project_jacobian(points_[i]),
                 Eigen::Matrix<double, 2, 0>(), 0);
      }
    if (rig_.light) observe_light(tie, points_[i], seen);
    return seen;
  }

  /// The equations of one point, its own unknowns eliminated (Schur complement).
  struct Reduced {
    Eigen::Matrix3d by_point_inverse = Eigen::Matrix3d::Zero();
    CommonByPoint mixed = CommonByPoint::Zero();
    Eigen::Vector3d point_right = Eigen::Vector3d::Zero();
  };

  /// \param weight_of_miss  of an observation, by how many standard deviations it misses
  template <class Weight>
  void step(const Weight& weight_of_miss) {
    CommonSquare normal = CommonSquare::Zero();
    Common right = Common::Zero();
    add_priors(normal, right);
    std::vector<Reduced> reduced(points_.size());
    for (std::size_t i = 0; i < points_.size(); ++i) {
      Eigen::Matrix3d by_point = Eigen::Matrix3d::Zero();
      Reduced& own = reduced[i];
      for (const Row& row : observe(i).rows) {
        const double robust = weight_of_miss(std::abs(row.miss));
        normal += robust * row.by_common * row.by_common.transpose();
        right -= robust * row.miss * row.by_common;
        own.mixed += robust * row.by_common * row.by_point.transpose();
        by_point += robust * row.by_point * row.by_point.transpose();
        own.point_right -= robust * row.miss * row.by_point;
      }
      // What keeps a point that all observations have left where it is.
      by_point.diagonal().array() += 1e-6;
      own.by_point_inverse = by_point.inverse();
      normal -= own.mixed * own.by_point_inverse * own.mixed.transpose();
      right -= own.mixed * own.by_point_inverse * own.point_right;
    }
    const Eigen::LDLT<CommonSquare> solver(normal);
    const Common change = solver.solve(right);
    covariance_ = solver.solve(CommonSquare::Identity());
    apply(change);
    for (std::size_t i = 0; i < points_.size(); ++i)
      points_[i] += reduced[i].by_point_inverse * (reduced[i].point_right - reduced[i].mixed.transpose() * change);
  }

  void add_priors(CommonSquare& normal, Common& right) const {
    Common sigma;
    for (int c = 0; c < 2; ++c) {
      sigma.segment<3>(c * pose_size).setConstant(priors_.turn_deg * radians_a_degree);
      sigma.segment<3>(c * pose_size + 3).setConstant(priors_.shift_mm);
    }
    sigma.tail<2>() << priors_.light_shift_mm, priors_.light_speed;
    normal.diagonal() += sigma.cwiseAbs2().cwiseInverse();
    Common moved = moved_;
    moved.tail<2>() = light_;
    right -= moved.cwiseQuotient(sigma.cwiseAbs2());
  }

  void apply(const Common& change) {
    for (std::size_t c = 0; c < 2; ++c) {
      const auto own = change.segment<pose_size>(static_cast<int>(c) * pose_size);
      Rigid3& pose = cameras_[c].cam_from_rig;
      const Rigid3 moved{rotation_by(own.head<3>()), own.tail<3>()};
      pose = moved * pose;
    }
    moved_ += change;
    light_ += change.tail<2>();
  }

  std::span<const TiePoint> ties_;
  std::array<Camera, 2> cameras_;
  const Rig& rig_;
  const DriftPriors& priors_;
  double middle_time_ = 0;
  std::vector<Eigen::Vector3d> points_;
  Common moved_ = Common::Zero();
  Eigen::Vector2d light_ = Eigen::Vector2d::Zero();
  CommonSquare covariance_ = CommonSquare::Zero();
};

}  // namespace

PoseCorrection correct_poses(std::span<const TiePoint> ties, const Camera& first, const Camera& second, const Rig& rig,
                             const DriftPriors& priors) {
  if (ties.size() < least_ties)
    throw Error(ErrorKind::no_result,
                fmt::format("only {} places with print were found in both cameras, {} are needed: lay a page with "
                            "text under the scanner and scan again",
                            ties.size(), least_ties));
  Adjustment adjustment(ties, first, second, rig, priors);
  adjustment.run();
  return adjustment.describe(first, second);
}

}  // namespace pagesweep
