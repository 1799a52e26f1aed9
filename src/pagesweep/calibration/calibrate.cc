// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/calibration/calibrate.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "pagesweep/base/error.h"
#include "pagesweep/calibration/calibration_steps_internal.h"

namespace pagesweep {
namespace {

double median_of(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Sets each sensor's sigma from its residuals, robustly, and tells which observations are outliers.
void weigh(Bundle& bundle, double outlier_sigmas) {
  // The length of a two-dimensional error with standard deviation 1 a coordinate has the median sqrt(2 ln 2).
  const double median_length = std::sqrt(2 * std::numbers::ln2);
  std::vector<std::vector<double>> lengths(bundle.sensors.size());
  std::vector<double> all;
  for (const Observation& seen : bundle.observations) {
    all.push_back(bundle.residual(seen).norm());
    if (std::isfinite(all.back())) lengths[std::size_t(seen.sensor)].push_back(all.back());
  }
  for (std::size_t k = 0; k < lengths.size(); ++k)
    if (!lengths[k].empty()) bundle.sensors[k].sigma_px = std::max(1e-3, median_of(lengths[k]) / median_length);
  for (std::size_t k = 0; k < all.size(); ++k) {
    Observation& seen = bundle.observations[k];
    seen.used = all[k] < outlier_sigmas * bundle.sensors[std::size_t(seen.sensor)].sigma_px;
  }
}

/// Least squares over the observations without outliers: what is one shows after the others had their say.
void adjust(Bundle& bundle, const CalibrationOptions& options) {
  BundleOptions bundle_options{options.lens, options.fit_stretch, options.fit_bend, 2.0, false};
  for (int round = 0; round < 2; ++round) {
    solve(bundle, bundle_options);
    weigh(bundle, options.outlier_sigmas);
  }
  bundle_options.robust_scale = 0;
  for (int round = 0; round < 2; ++round) {
    solve(bundle, bundle_options);
    weigh(bundle, options.outlier_sigmas);
  }
}

void move(Camera& camera, const Rigid3& new_from_old) {
  camera.cam_from_rig = camera.cam_from_rig * new_from_old.inverse();
}
void move(Pushbroom& line, const Rigid3& new_from_old) {
  line.center = new_from_old * line.center;
  line.step = new_from_old.rotation * line.step;
  line.rotation = line.rotation * new_from_old.rotation.transpose();
}
void move(RotatingLine& line, const Rigid3& new_from_old) {
  line.center = new_from_old * line.center;
  line.rotation = line.rotation * new_from_old.rotation.transpose();
}

void move(Bundle& bundle, const Rigid3& new_from_old) {
  for (Sensor& sensor : bundle.sensors) std::visit([&](auto& model) { move(model, new_from_old); }, sensor.model);
  for (Rigid3& rig_from_board : bundle.rig_from_board) rig_from_board = new_from_old * rig_from_board;
}

/// The direction on a board that is to become the rig's y axis, in the present frame.
Eigen::Vector3d sweep_direction(const Bundle& bundle, const Rigid3& rig_from_board, const Eigen::Vector3d& middle) {
  const Eigen::Vector3d normal = rig_from_board.rotation.col(2);
  const auto level = [&](const Eigen::Vector3d& v) -> Eigen::Vector3d { return v - normal.dot(v) * normal; };
  const Scanner last(bundle.sensors.back().model);
  const bool is_single = bundle.sensors.size() == 1;
  const bool has_scanner = bundle.sensors.back().name == scanner_name;
  if (has_scanner || is_single) {
    // The way across the table on which v grows and u stays.
    Eigen::Matrix<double, 2, 2> px_by_mm;
    const Eigen::Matrix3d& axes = rig_from_board.rotation;
    px_by_mm = last.project_jacobian(middle) * axes.leftCols<2>();
    const Eigen::Vector2d way = px_by_mm.inverse() * Eigen::Vector2d(0, 1);
    const Eigen::Vector3d rows = axes.leftCols<2>() * way;
    if (has_scanner) return rows.normalized();
    return nearest_axis(rig_from_board, rows);
  }
  const auto center = [&](std::size_t k) { return std::get<Camera>(bundle.sensors[k].model).center(); };
  return nearest_axis(rig_from_board, level(center(1) - center(0)));
}

}  // namespace

Eigen::Vector3d nearest_axis(const Rigid3& rig_from_board, const Eigen::Vector3d& direction) {
  const Eigen::Vector3d x = rig_from_board.rotation.col(0), y = rig_from_board.rotation.col(1);
  const double along_x = x.dot(direction), along_y = y.dot(direction);
  if (std::abs(along_x) > std::abs(along_y)) return along_x > 0 ? x : Eigen::Vector3d(-x);
  return along_y > 0 ? y : Eigen::Vector3d(-y);
}

namespace {

/// The direction in which the light moves over the table, in the present frame, from the flattest board that saw it;
/// zero if none did. On a tilted board the light's line lies otherwise than on the table.
Eigen::Vector3d light_direction(const CalibrationInput& input, const Bundle& bundle, const Eigen::Vector3d& up) {
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();
  double flattest = 0;
  for (const auto& [pose, on_board] : input.light_directions) {
    const auto is_of_it = [pose = pose](const Observation& seen) { return seen.pose == pose && seen.used; };
    const Eigen::Matrix3d& axes = bundle.rig_from_board[std::size_t(pose)].rotation;
    const double flatness = axes.col(2).dot(up);
    if (!(flatness > flattest) || !std::ranges::any_of(bundle.observations, is_of_it)) continue;
    flattest = flatness;
    const Eigen::Vector3d along = axes.leftCols<2>() * on_board;
    direction = (along - up.dot(along) * up).normalized();
  }
  return direction;
}

/// From the frame of the adjustment to the rig frame that calibrate() promises.
Rigid3 table_from_present(const CalibrationInput& input, const Bundle& bundle, int table_pose,
                          double board_thickness_mm) {
  const Rigid3& present_from_board = bundle.rig_from_board[std::size_t(table_pose)];
  const Eigen::Vector2d middle = bundle.board.middle_mm();
  const Eigen::Vector3d up = present_from_board.rotation.col(2);
  const Eigen::Vector3d print = present_from_board * Eigen::Vector3d(middle.x(), middle.y(), 0);
  const Eigen::Vector3d seen = light_direction(input, bundle, up);
  const Eigen::Vector3d y = seen.norm() > 0 ? seen : sweep_direction(bundle, present_from_board, print);
  Rigid3 present_from_table;
  present_from_table.rotation.col(0) = y.cross(up);
  present_from_table.rotation.col(1) = y;
  present_from_table.rotation.col(2) = up;
  present_from_table.translation = print - board_thickness_mm * up;
  return present_from_table.inverse();
}

int find_table_pose(const CalibrationInput& input, const Bundle& bundle, const std::string& wanted) {
  const auto is_seen = [&](int pose) {
    return std::ranges::any_of(bundle.observations, [&](const Observation& o) { return o.pose == pose && o.used; });
  };
  for (int k = 0; k < static_cast<int>(input.poses.size()); ++k) {
    if (!wanted.empty() && input.poses[std::size_t(k)] != wanted) continue;
    if (is_seen(k)) return k;
    if (!wanted.empty())
      throw no_result(fmt::format("the board is not seen in the pictures of the table, '{}'", wanted));
  }
  throw std::invalid_argument(fmt::format("--table-pose: no picture is called '{}'", wanted));
}

/// Puts everything into the rig frame and adjusts once more there, so that covariances refer to it: the table's pose is
/// what the frame is made of, so it is held.
BundleSolution settle_in_rig_frame(const CalibrationInput& input, Bundle& bundle, int table_pose,
                                   const CalibrationOptions& options) {
  move(bundle, table_from_present(input, bundle, table_pose, options.board_thickness_mm));
  for (Sensor& sensor : bundle.sensors) sensor.pose_is_held = false;
  bundle.pose_is_held[std::size_t(table_pose)] = true;
  BundleOptions last{options.lens, options.fit_stretch, options.fit_bend, 0, true};
  return solve(bundle, last);
}

double rms_of(const Bundle& bundle, int pose) {
  double squares = 0;
  int count = 0;
  for (const Observation& seen : bundle.observations) {
    if (seen.pose != pose || !seen.used) continue;
    squares += bundle.residual(seen).squaredNorm();
    ++count;
  }
  return count > 0 ? std::sqrt(squares / count) : std::numeric_limits<double>::quiet_NaN();
}

/// Each pose's rms when sensors and board are calibrated without it and only its own six numbers are fitted.
std::vector<double> leave_one_out(const Bundle& full, int table_pose, const CalibrationOptions& options,
                                  Progress& progress) {
  std::vector<double> rms;
  for (int pose = 0; pose < static_cast<int>(full.rig_from_board.size()); ++pose) {
    progress.advance(double(pose) / double(full.rig_from_board.size()));
    Bundle others = full, left_out = full;
    for (std::size_t k = 0; k < full.observations.size(); ++k)
      (full.observations[k].pose == pose ? others : left_out).observations[k].used = false;
    // The frame must not hang on the pose that is left out: a camera holds it instead.
    others.pose_is_held[std::size_t(table_pose)] = false;
    others.sensors.front().pose_is_held = true;
    solve(others, {options.lens, options.fit_stretch, options.fit_bend, 0, false});
    left_out.sensors = others.sensors;
    left_out.shape = others.shape;
    left_out.pose_is_held.assign(full.pose_is_held.size(), false);
    for (Sensor& sensor : left_out.sensors) sensor.pose_is_held = sensor.inside_is_held = true;
    const bool is_seen = std::isfinite(rms_of(left_out, pose));
    if (is_seen) solve(left_out, {});
    rms.push_back(rms_of(left_out, pose));
  }
  return rms;
}

Rig rig_of(const Bundle& bundle) {
  Rig rig;
  for (const Sensor& sensor : bundle.sensors) {
    if (sensor.name == scanner_name) {
      rig.scanner = Scanner(sensor.model);
    } else {
      rig.cameras.push_back(std::get<Camera>(sensor.model));
      rig.cameras.back().name = sensor.name;
    }
  }
  return rig;
}

}  // namespace

Calibration calibrate(const CalibrationInput& input, const CalibrationOptions& options, Progress& progress) {
  if (!(options.outlier_sigmas >= 2)) throw std::invalid_argument("--outlier-sigmas must be at least 2");
  Calibration result;
  progress.begin("calibrating each camera");
  result.bundle = start_cameras(input, options, result.warnings);
  progress.begin("adjusting all cameras");
  adjust(result.bundle, options);
  if (!input.sensors.empty() && input.sensors.back().is_scanner) {
    progress.begin("calibrating the scanner");
    add_scanner(input, options, result.bundle, result.trials, result.warnings);
    progress.begin("adjusting everything");
    adjust(result.bundle, options);
  }
  result.table_pose = find_table_pose(input, result.bundle, options.table_pose);
  result.solution = settle_in_rig_frame(input, result.bundle, result.table_pose, options);
  if (!result.solution.problem.empty())
    throw no_result(result.solution.problem + ": show the board tilted, turned and at other heights");
  if (options.cross_validate) {
    progress.begin("leaving out each pose");
    result.left_out_px = leave_one_out(result.bundle, result.table_pose, options, progress);
  }
  result.rig = rig_of(result.bundle);
  return result;
}

}  // namespace pagesweep
