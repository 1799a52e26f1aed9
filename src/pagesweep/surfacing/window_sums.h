// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "pagesweep/base/image.h"

namespace pagesweep {

/// The points of one cell of a grid, summed up. A cell without points has weight 0.
struct CellMean {
  float p = 0, q = 0;            ///< [mm] mean position against the cell's centre
  float z = 0;                   ///< [mm] mean height
  float pp = 0, pq = 0, qq = 0;  ///< [mm^2] covariance of the positions within the cell
  float weight = 0;              ///< [1/mm^2] sum of 1/sigma^2
  float intensity = 0;           ///< [gray values] mean
  int count = 0;                 ///< of points
};

/// What a fit needs of a grid's cells, one image an attribute, so that vectors hold neighbouring cells. Each row goes
/// on with some cells that have no points.
struct CellColumns {
  explicit CellColumns(const Image<CellMean>& cells);

  int width, height;  ///< of the grid
  Image<float> p, q, z, pp, pq, qq, weight;
};

/// Which cells of a grid belong to a window: those nearer to the middle of cell (column, row) than the radius and, if
/// `towards` is not zero, not more than three quarters of a cell behind it.
struct WindowPlace {
  int column, row;
  double cell_mm, radius_mm;
  double towards_p = 0, towards_q = 0;
};

/// The cells of one neighbourhood, one column an attribute, so that vectors hold neighbouring cells. Positions are over
/// the neighbourhood's radius.
struct Window {
  std::vector<float> u, v, uu, uv, vv;  ///< the paraboloid's terms, averaged over each cell
  std::vector<float> z;                 ///< [mm] against some height near all of them: floats are short
  std::vector<float> weight;            ///< [1/mm^2]
  std::vector<float> kernel;            ///< by distance
  std::vector<float> robust;            ///< by residual
  std::vector<float> residual;          ///< |z - fit| over what weight promises
  std::size_t size = 0;
  double z0_mm = 0;  ///< that height

  void reserve(std::size_t cells);
  /// To be called after the last cell: whole vectors are read, and cells beyond the last one weigh nothing.
  void pad();

  static constexpr std::size_t slack = 8;  ///< what a whole vector may reach over the end
};

/// The normal equations sum_i w_i x_i x_i' c = sum_i w_i z_i x_i with rows x = (1, u, v, uu, uv, vv) and
/// w = weight kernel robust.
struct WindowSums {
  /// Upper triangle, row by row. Element 0 is the sum of w.
  std::array<double, 21> a{};
  std::array<double, 6> b{};
};
WindowSums add_up(const Window& window);

/// Fills a window with cells, all but its robust weights. \return distance [mm] of the nearest one; the radius if there
/// is none
double gather(const CellColumns& cells, const WindowPlace& place, Window& window);

/// Puts |z - fit| sqrt(weight) into window.residual.
/// \param coefficients  of (1, u, v, uu, uv, vv)
void find_residuals(const std::array<float, 6>& coefficients, Window& window);

/// Median of window.residual, to a hundredth of their mean.
double median_residual(const Window& window);

/// Puts weights by residual / unit into window.robust: Tukey's biweight, or those of least absolute values beyond 1.
void weigh_residuals(double unit, bool redescending, Window& window);

/// sum_i (kernel_i robust_i x_i . influence)^2 weight_i
double sum_of_influence(const std::array<float, 6>& influence, const Window& window);

}  // namespace pagesweep
