// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/calibration/bundle.h"

#include <ceres/ceres.h>
#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <span>

#include "pagesweep/base/error.h"
#include "pagesweep/calibration/projection_internal.h"

namespace pagesweep {
namespace {

using projection::FrameCamera, projection::PushbroomLine, projection::TurningLine;
using Block = std::array<double, 6>;

constexpr int shape_size = 1 + BoardShape::bends;

Block pose_block(const Rigid3& pose) {
  const Eigen::AngleAxisd turn(pose.rotation);
  const Eigen::Vector3d w = turn.angle() * turn.axis();
  return {w.x(), w.y(), w.z(), pose.translation.x(), pose.translation.y(), pose.translation.z()};
}

Eigen::Matrix3d rotation_of(const double* w) {
  const Eigen::Vector3d turn(w[0], w[1], w[2]);
  const double angle = turn.norm();
  return angle > 0 ? Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix() : Eigen::Matrix3d::Identity();
}

std::array<double, shape_size> shape_block(const BoardShape& shape) {
  std::array<double, shape_size> block{shape.stretch};
  std::ranges::copy(shape.bend_mm, block.begin() + 1);
  return block;
}

// ---- the three models: their parameters as a block of numbers ----

/// A sensor as numbers: what the solver changes.
struct SensorBlock {
  std::vector<double> inside;
  Block pose{};  ///< turn, centre
};

struct Named {
  const char *name, *unit;
};

SensorBlock block_of(const Camera& c) {
  const BrownConrady& d = c.distortion;
  const Eigen::Vector3d center = c.center();
  return {{c.fx, c.fy, c.cx, c.cy, d.k1, d.k2, d.p1, d.p2, d.k3}, {0, 0, 0, center.x(), center.y(), center.z()}};
}
SensorBlock block_of(const Pushbroom& l) {
  return {{l.f, l.cx, l.k1, l.step.x(), l.step.y(), l.step.z()}, {0, 0, 0, l.center.x(), l.center.y(), l.center.z()}};
}
SensorBlock block_of(const RotatingLine& l) {
  return {{l.f, l.cx, l.k1, l.angle_step}, {0, 0, 0, l.center.x(), l.center.y(), l.center.z()}};
}

void take(Camera& c, const SensorBlock& b) {
  const auto& in = b.inside;
  c.fx = in[0], c.fy = in[1], c.cx = in[2], c.cy = in[3];
  c.distortion = {in[4], in[5], in[6], in[7], in[8]};
  c.cam_from_rig.rotation = c.cam_from_rig.rotation * rotation_of(b.pose.data());
  c.cam_from_rig.translation = -(c.cam_from_rig.rotation * Eigen::Vector3d(b.pose[3], b.pose[4], b.pose[5]));
}
void take(Pushbroom& l, const SensorBlock& b) {
  l.f = b.inside[0], l.cx = b.inside[1], l.k1 = b.inside[2];
  l.step = {b.inside[3], b.inside[4], b.inside[5]};
  l.rotation = l.rotation * rotation_of(b.pose.data());
  l.center = {b.pose[3], b.pose[4], b.pose[5]};
}
void take(RotatingLine& l, const SensorBlock& b) {
  l.f = b.inside[0], l.cx = b.inside[1], l.k1 = b.inside[2], l.angle_step = b.inside[3];
  l.rotation = l.rotation * rotation_of(b.pose.data());
  l.center = {b.pose[3], b.pose[4], b.pose[5]};
}

FrameCamera projection_of(const Camera& c) { return {c.cam_from_rig.rotation}; }
PushbroomLine projection_of(const Pushbroom& l) { return {l.rotation}; }
TurningLine projection_of(const RotatingLine& l) { return {l.rotation, l.angle0}; }

std::vector<Named> names_of(const Camera&) {
  return {{"fx", "px"}, {"fy", "px"}, {"cx", "px"}, {"cy", "px"}, {"k1", ""},
          {"k2", ""},   {"p1", ""},   {"p2", ""},   {"k3", ""}};
}
std::vector<Named> names_of(const Pushbroom&) {
  return {{"f", "px"}, {"cx", "px"}, {"k1", ""}, {"step_x", "mm"}, {"step_y", "mm"}, {"step_z", "mm"}};
}
std::vector<Named> names_of(const RotatingLine&) {
  return {{"f", "px"}, {"cx", "px"}, {"k1", ""}, {"angle_step", "rad"}};
}
constexpr auto pose_names = std::to_array<Named>({{"turn_x", "rad"},
                                                  {"turn_y", "rad"},
                                                  {"turn_z", "rad"},
                                                  {"center_x", "mm"},
                                                  {"center_y", "mm"},
                                                  {"center_z", "mm"}});

/// Which of a camera's parameters stay as they are.
std::vector<int> held_inside(const Camera&, LensModel lens) {
  switch (lens) {
    case LensModel::full:
      return {};
    case LensModel::k1_k2_tangential:
      return {8};
    case LensModel::k1_k2:
      return {6, 7, 8};
    case LensModel::k1:
      break;
  }
  return {5, 6, 7, 8};
}
std::vector<int> held_inside(const Pushbroom&, LensModel) { return {}; }
std::vector<int> held_inside(const RotatingLine&, LensModel) { return {}; }

/// Seen minus predicted, in standard deviations.
template <class Projection>
struct CornerError {
  Projection project;
  const Board* board;
  int corner;
  Eigen::Vector2d pixel;
  double weight;
  std::array<double, shape_size> known_shape;

  /// With the board's shape as an unknown.
  template <class T>
  bool operator()(const T* inside, const T* pose, const T* rig_from_board, const T* shape, T* residual) const {
    return compare(inside, pose, rig_from_board, shape, residual);
  }
  /// With a shape that is known: a third fewer derivatives.
  template <class T>
  bool operator()(const T* inside, const T* pose, const T* rig_from_board, T* residual) const {
    return compare(inside, pose, rig_from_board, known_shape.data(), residual);
  }

 private:
  template <class T, class S>
  bool compare(const T* inside, const T* pose, const T* rig_from_board, const S* shape, T* residual) const {
    projection::Vector2<T> image;
    if (!projection::corner_pixel(project, *board, corner, inside, pose, rig_from_board, shape, image)) return false;
    residual[0] = (pixel.x() - image.x()) * weight;
    residual[1] = (pixel.y() - image.y()) * weight;
    return true;
  }
};

template <class Projection>
ceres::CostFunction* make_cost(const Projection& project, const Bundle& bundle, const Observation& seen,
                               bool shape_is_known) {
  using Error = CornerError<Projection>;
  constexpr int inside = Projection::inside;
  const double weight = 1 / bundle.sensors[std::size_t(seen.sensor)].sigma_px;
  auto* error = new Error{project, &bundle.board, seen.corner, seen.pixel, weight, shape_block(bundle.shape)};
  if (shape_is_known) return new ceres::AutoDiffCostFunction<Error, 2, inside, 6, 6>(error);
  return new ceres::AutoDiffCostFunction<Error, 2, inside, 6, 6, shape_size>(error);
}

/// The problem as Ceres sees it, with the numbers that it works on.
class Adjustment {
 public:
  Adjustment(const Bundle& bundle, const BundleOptions& options) : bundle_(bundle), options_(options) {
    for (const Sensor& sensor : bundle.sensors)
      sensors_.push_back(std::visit([](const auto& model) { return block_of(model); }, sensor.model));
    for (const Rigid3& pose : bundle.rig_from_board) poses_.push_back(pose_block(pose));
    shape_ = shape_block(bundle.shape);
    add_observations();
    hold_what_is_held();
  }

  ceres::Solver::Summary run() {
    ceres::Solver::Options solver;
    solver.linear_solver_type = ceres::DENSE_SCHUR;
    solver.max_num_iterations = 200;
    solver.function_tolerance = 1e-10;
    solver.parameter_tolerance = 1e-12;
    solver.num_threads = 1;  // sums in one order: the same result wherever it runs
    solver.logging_type = ceres::SILENT;
    auto* order = new ceres::ParameterBlockOrdering;
    for (Block& pose : poses_)
      if (problem_.HasParameterBlock(pose.data())) order->AddElementToGroup(pose.data(), 0);
    for (SensorBlock& sensor : sensors_)
      for (double* block : {sensor.inside.data(), sensor.pose.data()})
        if (problem_.HasParameterBlock(block)) order->AddElementToGroup(block, 1);
    if (problem_.HasParameterBlock(shape_.data())) order->AddElementToGroup(shape_.data(), 1);
    solver.linear_solver_ordering.reset(order);
    ceres::Solver::Summary summary;
    ceres::Solve(solver, &problem_, &summary);
    return summary;
  }

  void store(Bundle& bundle) const {
    for (std::size_t k = 0; k < sensors_.size(); ++k)
      std::visit([&](auto& model) { take(model, sensors_[k]); }, bundle.sensors[k].model);
    for (std::size_t k = 0; k < poses_.size(); ++k)
      if (!bundle.pose_is_held[k])
        bundle.rig_from_board[k] = {rotation_of(poses_[k].data()), {poses_[k][3], poses_[k][4], poses_[k][5]}};
    bundle.shape.stretch = shape_[0];
    std::copy(shape_.begin() + 1, shape_.end(), bundle.shape.bend_mm.begin());
  }

  void describe(BundleSolution& solution);

 private:
  void add_observations() {
    for (const Observation& seen : bundle_.observations) {
      if (!seen.used) continue;
      const auto sensor = static_cast<std::size_t>(seen.sensor);
      const bool shape_is_known = !options_.fit_bend && !options_.fit_stretch;
      ceres::CostFunction* cost =
          std::visit([&](const auto& model) { return make_cost(projection_of(model), bundle_, seen, shape_is_known); },
                     bundle_.sensors[sensor].model);
      ceres::LossFunction* loss = options_.robust_scale > 0 ? new ceres::CauchyLoss(options_.robust_scale) : nullptr;
      std::vector<double*> blocks{sensors_[sensor].inside.data(), sensors_[sensor].pose.data(),
                                  poses_[std::size_t(seen.pose)].data()};
      if (!shape_is_known) blocks.push_back(shape_.data());
      problem_.AddResidualBlock(cost, loss, blocks);
    }
  }

  void hold(double* block) {
    if (problem_.HasParameterBlock(block)) problem_.SetParameterBlockConstant(block);
  }

  void hold_what_is_held() {
    for (std::size_t k = 0; k < sensors_.size(); ++k) {
      double* inside = sensors_[k].inside.data();
      if (bundle_.sensors[k].pose_is_held) hold(sensors_[k].pose.data());
      if (bundle_.sensors[k].inside_is_held) hold(inside);
      const auto held =
          std::visit([&](const auto& model) { return held_inside(model, options_.lens); }, bundle_.sensors[k].model);
      if (!held.empty() && problem_.HasParameterBlock(inside) && !bundle_.sensors[k].inside_is_held)
        problem_.SetManifold(inside, new ceres::SubsetManifold(static_cast<int>(sensors_[k].inside.size()), held));
    }
    for (std::size_t k = 0; k < poses_.size(); ++k)
      if (bundle_.pose_is_held[k]) hold(poses_[k].data());
    hold_shape();
  }

  void hold_shape() {
    if (!problem_.HasParameterBlock(shape_.data())) return;
    std::vector<int> held;
    if (!options_.fit_stretch) held.push_back(0);
    if (!options_.fit_bend)
      for (int k = 1; k < shape_size; ++k) held.push_back(k);
    if (!held.empty()) problem_.SetManifold(shape_.data(), new ceres::SubsetManifold(shape_size, held));
  }

  const Bundle& bundle_;
  const BundleOptions& options_;
  std::vector<SensorBlock> sensors_;
  std::vector<Block> poses_;
  std::array<double, shape_size> shape_{};
  ceres::Problem problem_;
};

/// A dense copy of J^T J from Ceres' sparse J, and the number of rows.
Eigen::MatrixXd normal_matrix(const ceres::CRSMatrix& jacobian) {
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(jacobian.num_cols, jacobian.num_cols);
  for (int row = 0; row < jacobian.num_rows; ++row) {
    const auto begin = static_cast<std::size_t>(jacobian.rows[std::size_t(row)]);
    const auto end = static_cast<std::size_t>(jacobian.rows[std::size_t(row) + 1]);
    for (std::size_t a = begin; a < end; ++a)
      for (std::size_t b = begin; b < end; ++b)
        normal(jacobian.cols[a], jacobian.cols[b]) += jacobian.values[a] * jacobian.values[b];
  }
  return normal;
}

/// Inverse of a normal matrix; a parameter that the observations leave open is named in `problem`.
Eigen::MatrixXd inverse_of(const Eigen::MatrixXd& normal, const std::vector<Parameter>& parameters,
                           std::string& problem) {
  Eigen::VectorXd scale = normal.diagonal().cwiseSqrt();
  for (double& s : scale) s = s > 0 ? 1 / s : 1;
  const Eigen::MatrixXd scaled = scale.asDiagonal() * normal * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled);
  const Eigen::VectorXd& values = eigen.eigenvalues();
  // Below this, the parameters' combination drowns in the rounding of the sums.
  const double least = 1e-13 * values[values.size() - 1];
  if (!(values[0] > least)) {
    Eigen::Index which = 0;
    eigen.eigenvectors().col(0).cwiseAbs().maxCoeff(&which);
    const Parameter& open = parameters[std::size_t(which)];
    problem = fmt::format("the pictures leave {} of {} open", open.name, open.owner);
  }
  const Eigen::VectorXd inverse = values.cwiseMax(least).cwiseInverse();
  return scale.asDiagonal() * (eigen.eigenvectors() * inverse.asDiagonal() * eigen.eigenvectors().transpose()) *
         scale.asDiagonal();
}

}  // namespace

void Adjustment::describe(BundleSolution& solution) {
  std::vector<double*> blocks;
  const auto add = [&](double* block, const std::string& owner, std::span<const Named> names) {
    if (!problem_.HasParameterBlock(block) || problem_.IsParameterBlockConstant(block)) return;
    blocks.push_back(block);
    // With a manifold the Jacobian has one column for each number that is free, in their order.
    std::vector<bool> free(names.size(), true);
    if (const auto* manifold = problem_.GetManifold(block)) {
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> plus(manifold->AmbientSize(),
                                                                                  manifold->TangentSize());
      manifold->PlusJacobian(block, plus.data());
      for (std::size_t k = 0; k < names.size(); ++k) free[k] = plus.row(Eigen::Index(k)).any();
    }
    for (std::size_t k = 0; k < names.size(); ++k)
      if (free[k]) solution.parameters.push_back({owner, names[k].name, names[k].unit, block[k]});
  };
  for (std::size_t k = 0; k < sensors_.size(); ++k) {
    const std::string& owner = bundle_.sensors[k].name;
    add(sensors_[k].inside.data(), owner,
        std::visit([](const auto& model) { return names_of(model); }, bundle_.sensors[k].model));
    add(sensors_[k].pose.data(), owner, pose_names);
  }
  std::vector<Named> shape_names(shape_size, {"bend", "mm"});
  shape_names[0] = {"stretch", ""};
  add(shape_.data(), "board", shape_names);
  for (std::size_t k = 0; k < poses_.size(); ++k) add(poses_[k].data(), fmt::format("pose {}", k + 1), pose_names);

  ceres::Problem::EvaluateOptions wanted;
  wanted.parameter_blocks = blocks;
  wanted.apply_loss_function = false;
  ceres::CRSMatrix jacobian;
  double cost = 0;
  problem_.Evaluate(wanted, &cost, nullptr, nullptr, &jacobian);
  solution.redundancy = jacobian.num_rows - jacobian.num_cols;
  solution.unit_sigma = std::sqrt(2 * cost / std::max(1.0, solution.redundancy));
  solution.covariance =
      std::pow(solution.unit_sigma, 2) * inverse_of(normal_matrix(jacobian), solution.parameters, solution.problem);
}

Eigen::Vector3d BoardShape::corner_mm(const Board& board, int corner) const {
  return projection::board_point(board.corner_mm(corner), board.size_mm(), shape_block(*this).data());
}

std::optional<Eigen::Vector2d> Bundle::predict(int sensor, int pose, int corner) const {
  const auto see = [&](const auto& model) -> std::optional<Eigen::Vector2d> {
    const SensorBlock block = block_of(model);
    Eigen::Vector2d pixel;
    const bool seen = projection::corner_pixel(projection_of(model), board, corner, block.inside.data(),
                                               block.pose.data(), pose_block(rig_from_board[std::size_t(pose)]).data(),
                                               shape_block(shape).data(), pixel);
    return seen ? std::optional(pixel) : std::nullopt;
  };
  return std::visit(see, sensors[std::size_t(sensor)].model);
}

Eigen::Vector2d Bundle::residual(const Observation& observation) const {
  const auto predicted = predict(observation.sensor, observation.pose, observation.corner);
  if (!predicted) return Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  return observation.pixel - *predicted;
}

BundleSolution solve(Bundle& bundle, const BundleOptions& options) {
  Adjustment adjustment(bundle, options);
  const ceres::Solver::Summary summary = adjustment.run();
  if (!summary.IsSolutionUsable())
    throw no_result(
        "the calibration did not get off its start values: do all pictures belong to the board's definition?");
  BundleSolution solution;
  solution.iterations = static_cast<int>(summary.iterations.size());
  if (options.with_covariance) adjustment.describe(solution);
  adjustment.store(bundle);
  return solution;
}

std::vector<std::string> parameter_names(const Scanner::Model& model) {
  std::vector<std::string> names;
  for (const Named& named : std::visit([](const auto& m) { return names_of(m); }, model))
    names.emplace_back(named.name);
  for (const Named& named : pose_names) names.emplace_back(named.name);
  return names;
}

Eigen::MatrixXd parameter_jacobian(const Scanner::Model& model, const Eigen::Vector3d& rig_point) {
  const auto differentiate = [&](const auto& m) {
    SensorBlock block = block_of(m);
    const auto project = projection_of(m);
    const auto inside = static_cast<Eigen::Index>(block.inside.size());
    const auto see = [&] {
      Eigen::Vector2d pixel = Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
      project(block.inside.data(), block.pose.data(), rig_point, pixel);
      return pixel;
    };
    Eigen::MatrixXd jacobian(2, inside + 6);
    for (Eigen::Index k = 0; k < inside + 6; ++k) {
      double& number = k < inside ? block.inside[std::size_t(k)] : block.pose[std::size_t(k - inside)];
      const double kept = number, step = 1e-5 * std::max(std::abs(kept), 1e-2);
      number = kept + step;
      const Eigen::Vector2d above = see();
      number = kept - step;
      jacobian.col(k) = (above - see()) / (2 * step);
      number = kept;
    }
    return jacobian;
  };
  return std::visit(differentiate, model);
}

}  // namespace pagesweep
