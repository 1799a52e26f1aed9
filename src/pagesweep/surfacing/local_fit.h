// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
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

/// z(u, v) = z + a u + b v + c u^2 + d u v + e v^2 around a cell's centre, (u, v) [mm] along (p, q).
struct LocalFit {
  bool ok = false;
  double z = 0;                    ///< [mm]
  double sigma = 0;                ///< [mm] one standard deviation of z, from the points' own sigma
  double scatter = 0;              ///< robust scale of the residuals over what the weights promise: 1 where all is well
  double scatter_mm = 0;           ///< [mm] robust scale of the residuals
  std::array<double, 5> slopes{};  ///< a, b, c, d, e [1, 1, 1/mm, 1/mm, 1/mm]

  double at(double u, double v) const {
    return z + slopes[0] * u + slopes[1] * v + slopes[2] * u * u + slopes[3] * u * v + slopes[4] * v * v;
  }
};

/// Robust weighted least squares of a paraboloid (a plane where that is all the cells support) to the cells around one.
///
/// A cell enters by the mean of its points' rows of the design matrix, so that its width costs no bias. Weights are
/// weight * (1 - d^2/R^2)^2 * Tukey's; the first steps are least absolute values, which outliers do not lead astray.
class LocalFitter {
 public:
  /// Which cells take part: those within radius_mm, and, if `towards` is not zero, only on that side.
  struct Window {
    double radius_mm;
    Eigen::Vector2d towards = Eigen::Vector2d::Zero();
  };
  /// \param cells  must outlive the fitter
  LocalFitter(const Image<CellMean>& cells, double cell_mm) : cells_(cells), cell_mm_(cell_mm) {}

  /// \param steps  robust steps: 0 is plain least squares, 2 suffice for clean cells, 6 start from nothing
  LocalFit fit(int column, int row, const Window& window, int steps);
  /// As fit(), but where the residuals are `too_much` times what the weights promise the surface has an edge within
  /// the window: then the best of a smaller window and eight one-sided ones is taken.
  LocalFit fit_along_edges(int column, int row, double radius_mm, int steps, double too_much);

 private:
  struct Sample {
    double u, v, uu, uv, vv;  // over the radius
    double z, weight, kernel, robust;
  };
  void gather(int column, int row, const Window& window);
  template <int Terms>
  LocalFit solve(double radius_mm, int steps);
  template <int Terms>
  double reweight(const Eigen::Matrix<double, Terms, 1>& solution, bool redescending);

  const Image<CellMean>& cells_;
  double cell_mm_;
  std::vector<Sample> samples_;
  std::vector<double> residuals_;
  double nearest_mm_ = 0;
};

}  // namespace pagesweep
