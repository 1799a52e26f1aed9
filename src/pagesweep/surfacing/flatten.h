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

/// Bicubic (Catmull-Rom) interpolation of nodes, straight on beyond the border.
template <class T>
T interpolate_nodes(const Image<T>& nodes, double i, double j) {
  const int i0 = static_cast<int>(std::clamp(std::floor(i), 0.0, std::max(0.0, nodes.width() - 2.0)));
  const int j0 = static_cast<int>(std::clamp(std::floor(j), 0.0, std::max(0.0, nodes.height() - 2.0)));
  // The four nodes' weights; nodes beyond the border are extrapolated from the two at it.
  const auto weights = [](double x, int first, int count) {
    std::array<double, 4> w{0, 1 - x, x, 0};
    if (x >= 0 && x <= 1) w = catmull_rom_weights(x);
    if (first == 0) w = {0, w[1] + 2 * w[0], w[2] - w[0], w[3]};
    if (first + 2 >= count) w = {w[0], w[1] - w[3], w[2] + 2 * w[3], 0};
    return w;
  };
  const auto wi = weights(i - i0, i0, nodes.width()), wj = weights(j - j0, j0, nodes.height());
  T sum = nodes(i0, j0) * 0;
  for (int b = 0; b < 4; ++b)
    for (int a = 0; a < 4; ++a)
      if (const double w = wi[static_cast<std::size_t>(a)] * wj[static_cast<std::size_t>(b)]; w != 0)
        sum += nodes(i0 - 1 + a, j0 - 1 + b) * w;
  return sum;
}

}  // namespace pagesweep
