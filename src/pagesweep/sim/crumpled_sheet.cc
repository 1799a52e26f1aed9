// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/sim/crumpled_sheet.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "pagesweep/sim/random.h"

namespace pagesweep::sim {
namespace {

constexpr double grid_mm = 2;  // on which mirrors are tried
constexpr double few = 0.002;  // share of facets that may be steeper: those that a crease crosses
constexpr double least_tilt_rad = 0.035, largest_tilt_rad = 0.19;
constexpr int tries_per_fold = 200;

struct Grid {
  Grid(double width_mm, double height_mm)
      : columns(static_cast<int>(width_mm / grid_mm) + 1), rows(static_cast<int>(height_mm / grid_mm) + 1) {
    for (int j = 0; j < rows; ++j)
      for (int i = 0; i < columns; ++i)
        nodes.emplace_back(i * grid_mm - 0.5 * width_mm, 0.5 * height_mm - j * grid_mm, 0);
  }
  const Eigen::Vector3d& at(int i, int j) const { return nodes[static_cast<std::size_t>(j * columns + i)]; }

  int columns, rows;
  std::vector<Eigen::Vector3d> nodes;
};

bool is_too_steep(const Grid& grid, double steepest_rad) {
  const double lowest_cosine = std::cos(steepest_rad);
  int steep = 0;
  for (int j = 0; j + 1 < grid.rows; ++j)
    for (int i = 0; i + 1 < grid.columns; ++i) {
      const Eigen::Vector3d right = grid.at(i + 1, j) - grid.at(i, j), down = grid.at(i, j + 1) - grid.at(i, j);
      steep += down.cross(right).normalized().z() < lowest_cosine;
    }
  return steep > few * (grid.rows - 1) * (grid.columns - 1);
}

/// Whether creases crowd: in too many places half of the nodes along 16 mm of a line bend. Paper is too stiff for that.
bool is_crowded(const Grid& grid) {
  constexpr int window = 8, most = 4;
  const double least_bend = 0.03;  // [rad]
  int crowded = 0, windows = 0;
  const auto follow = [&](int count, const auto& node) {
    std::vector<int> bends{0};  // how many up to a node
    for (int k = 1; k + 1 < count; ++k) {
      const Eigen::Vector3d before = node(k) - node(k - 1), after = node(k + 1) - node(k);
      bends.push_back(bends.back() + (before.cross(after).norm() > least_bend * before.norm() * after.norm()));
    }
    for (std::size_t k = window; k < bends.size(); ++k, ++windows) crowded += bends[k] - bends[k - window] > most;
  };
  for (int j = 0; j < grid.rows; ++j) follow(grid.columns, [&](int i) { return grid.at(i, j); });
  for (int i = 0; i < grid.columns; ++i) follow(grid.rows, [&](int j) { return grid.at(i, j); });
  return crowded > few * windows;
}

double roughness(const std::vector<Eigen::Vector3d>& nodes) {
  double mean = 0, squares = 0;
  for (const Eigen::Vector3d& node : nodes) mean += node.z() / static_cast<double>(nodes.size());
  for (const Eigen::Vector3d& node : nodes) squares += std::pow(node.z() - mean, 2);
  return std::sqrt(squares / static_cast<double>(nodes.size()));
}

}  // namespace

Eigen::Vector3d CrumpledSheet::Fold::mirrored(const Eigen::Vector3d& x) const {
  return x - 2 * std::max(0.0, normal.dot(x) - distance_mm) * normal;
}

/// Turns the plane that fits best to the nodes to the level z = 0, and the nodes' middle to the origin.
void CrumpledSheet::lay_level(const std::vector<Eigen::Vector3d>& nodes, Fold& fold) {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& node : nodes) middle += node / static_cast<double>(nodes.size());
  Eigen::Matrix2d plan = Eigen::Matrix2d::Zero();
  Eigen::Vector2d rise = Eigen::Vector2d::Zero();
  for (const Eigen::Vector3d& node : nodes) {
    const Eigen::Vector3d arm = node - middle;
    plan += arm.head<2>() * arm.head<2>().transpose();
    rise += arm.z() * arm.head<2>();
  }
  const Eigen::Vector2d slope = plan.ldlt().solve(rise);
  const Eigen::Vector3d normal = Eigen::Vector3d(-slope.x(), -slope.y(), 1).normalized();
  fold.turn = Eigen::Quaterniond::FromTwoVectors(normal, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  fold.shift = -(fold.turn * middle);
}

CrumpledSheet::CrumpledSheet(double width_mm, double height_mm, const Crumple& crumple)
    : width_mm_(width_mm), height_mm_(height_mm) {
  const CounterRandom random(static_cast<std::uint64_t>(crumple.seed), 0xC2);
  Grid grid(width_mm, height_mm);
  std::uint64_t draw = 0;
  for (int attempt = 0; attempt < tries_per_fold * crumple.folds && folds() < crumple.folds; ++attempt) {
    const double tilt = least_tilt_rad + (largest_tilt_rad - least_tilt_rad) * random.uniform(draw++);
    const double towards = 2 * std::numbers::pi * random.uniform(draw++);
    const double side = random.uniform(draw++) < 0.5 ? -1 : 1;
    const auto node = static_cast<std::size_t>(random.uniform(draw++) * static_cast<double>(grid.nodes.size()));
    Fold fold;
    fold.normal =
        side * Eigen::Vector3d(std::sin(tilt) * std::cos(towards), std::sin(tilt) * std::sin(towards), std::cos(tilt));
    fold.distance_mm = fold.normal.dot(grid.nodes[node]);
    Grid folded = grid;
    for (Eigen::Vector3d& place : folded.nodes) place = fold.mirrored(place);
    lay_level(folded.nodes, fold);
    for (Eigen::Vector3d& place : folded.nodes) place = fold.turn * place + fold.shift;
    if (roughness(folded.nodes) > crumple.roughness_mm || is_too_steep(folded, crumple.steepest_rad) ||
        is_crowded(folded))
      continue;
    grid = std::move(folded);
    folds_.push_back(fold);
  }
  for (const Eigen::Vector3d& place : grid.nodes) lowest_mm_ = std::min(lowest_mm_, place.z());
}

Eigen::Vector3d CrumpledSheet::at(double s_mm, double t_mm) const {
  Eigen::Vector3d place(s_mm - 0.5 * width_mm_, 0.5 * height_mm_ - t_mm, 0);
  for (const Fold& fold : folds_) place = fold * place;
  return place - Eigen::Vector3d(0, 0, lowest_mm_);
}

}  // namespace pagesweep::sim
