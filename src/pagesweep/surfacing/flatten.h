// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "pagesweep/base/catmull_rom.h"
#include "pagesweep/base/image.h"

namespace pagesweep {

/// A surface over a grid of parameters: node (i, j) lies at at(i, j), and the surface between them at fractions.
struct Sheet {
  int columns = 0, rows = 0;
  std::function<Eigen::Vector3d(double i, double j)> at;  ///< [mm]
  /// How much the lengths at a node count; 1 if empty. Where the surface is a guess they should bend to the rest.
  std::function<double(int i, int j)> weight = {};
};

/// How true the flattening is to the surface: relative errors of the lengths of all edges and diagonals of the grid.
struct Distortion {
  double rms = 0, largest = 0;
};

/// Where the nodes of a sheet come to lie when it is laid flat without stretching: least squares of the relative length
/// errors of all grid edges and diagonals, by Gauss-Newton steps from `start`. Exact where the surface is developable,
/// the best compromise where it is not. The result keeps the start's place and direction at the middle node.
/// \param start  [mm] one place a node, roughly true and not mirrored
/// \throws std::invalid_argument  if start has not the sheet's size, or the sheet fewer than 2 x 2 nodes
Image<Eigen::Vector2d> flatten(const Sheet& sheet, const Image<Eigen::Vector2d>& start,
                               Distortion* distortion = nullptr);

/// The four nodes around a position along one axis: the first one's index, and weights of Catmull-Rom interpolation,
/// straight on beyond the border. A node beyond the border weighs nothing.
struct NodeWeights {
  NodeWeights(double position, int count)
      : first(static_cast<int>(std::clamp(std::floor(position), 0.0, std::max(0.0, count - 2.0))) - 1),
        x(position - (first + 1)),
        at_low_border(first < 0),
        at_high_border(first + 3 >= count) {}

  std::array<double, 4> values() const {
    return within(is_between() ? catmull_rom_weights(x) : std::array<double, 4>{0, 1 - x, x, 0});
  }
  /// Their derivatives with respect to the position.
  std::array<double, 4> slopes() const {
    return within(is_between() ? catmull_rom_slopes(x) : std::array<double, 4>{0, -1, 1, 0});
  }

  int first;
  double x;
  bool at_low_border, at_high_border;

 private:
  bool is_between() const { return x >= 0 && x <= 1; }
  /// Nodes beyond the border are extrapolated from the two at it.
  std::array<double, 4> within(std::array<double, 4> w) const {
    if (at_low_border) w = {0, w[1] + 2 * w[0], w[2] - w[0], w[3]};
    if (at_high_border) w = {w[0], w[1] - w[3], w[2] + 2 * w[3], 0};
    return w;
  }
};

/// Bicubic (Catmull-Rom) interpolation of nodes, straight on beyond the border.
template <class T>
T interpolate_nodes(const Image<T>& nodes, double i, double j) {
  const NodeWeights columns(i, nodes.width()), rows(j, nodes.height());
  const auto wi = columns.values(), wj = rows.values();
  T sum = nodes(columns.first + 1, rows.first + 1) * 0;
  for (int b = 0; b < 4; ++b)
    for (int a = 0; a < 4; ++a)
      if (const double w = wi[static_cast<std::size_t>(a)] * wj[static_cast<std::size_t>(b)]; w != 0)
        sum += nodes(columns.first + a, rows.first + b) * w;
  return sum;
}

/// What interpolate_nodes() gives, and its derivatives with respect to i and j.
struct InterpolatedNode {
  Eigen::Vector2d value = Eigen::Vector2d::Zero();
  Eigen::Matrix2d jacobian = Eigen::Matrix2d::Zero();  ///< columns: d / di, d / dj
};
InterpolatedNode differentiate_nodes(const Image<Eigen::Vector2d>& nodes, double i, double j);

}  // namespace pagesweep
