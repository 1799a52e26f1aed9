// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "pagesweep/base/image.h"
#include "pagesweep/surfacing/window_sums.h"

namespace pagesweep {

/// z(u, v) = z + a u + b v + c u^2 + d u v + e v^2 around a cell's centre, (u, v) [mm] along (p, q).
struct LocalFit {
  bool ok = false;
  bool at_edge = false;            ///< the whole neighbourhood did not fit: see LocalFitter::fit_along_edges()
  double z = 0;                    ///< [mm]
  double sigma = 0;                ///< [mm] one standard deviation of z, from the points' own sigma
  double scatter = 0;              ///< robust scale of the residuals over what the weights promise: 1 where all is well
  double scatter_mm = 0;           ///< [mm] robust scale of the residuals
  std::array<double, 5> slopes{};  ///< a, b, c, d, e [1, 1, 1/mm, 1/mm, 1/mm]

  double at(double u, double v) const {
    return z + slopes[0] * u + slopes[1] * v + slopes[2] * u * u + slopes[3] * u * v + slopes[4] * v * v;
  }
  /// The same paraboloid around the place (u, v).
  LocalFit moved(double u, double v) const;
};

/// Robust weighted least squares of a paraboloid (a plane where that is all the cells support) to the cells around one.
///
/// A cell enters by the mean of its points' rows of the design matrix, so that its width costs no bias. Weights are
/// weight * (1 - d^2/R^2)^2 * Tukey's; the first steps are least absolute values, which outliers do not lead astray.
class LocalFitter {
 public:
  /// Which cells take part: those within radius_mm, and, if `towards` is not zero, only on that side.
  struct Neighbourhood {
    double radius_mm;
    Eigen::Vector2d towards = Eigen::Vector2d::Zero();
  };
  /// \param cells  must outlive the fitter
  LocalFitter(const CellColumns& cells, double cell_mm) : cells_(cells), cell_mm_(cell_mm) {}

  /// \param steps  robust steps: 0 is plain least squares, 2 suffice for clean cells, 6 start from nothing
  LocalFit fit(int column, int row, const Neighbourhood& neighbourhood, int steps);
  /// As fit(), but where the residuals are `too_much` times what the weights promise the surface has an edge within
  /// the window: then the best of a smaller window and eight one-sided ones is taken.
  LocalFit fit_along_edges(int column, int row, double radius_mm, int steps, double too_much);

 private:
  template <int Terms>
  LocalFit solve(double radius_mm, int steps);

  const CellColumns& cells_;
  double cell_mm_;
  Window window_;
};

/// How fit_cells() fits.
struct LocalFitOptions {
  double radius_mm = 6;
  int steps = 2;         ///< robust steps, see LocalFitter::fit()
  double too_much = 10;  ///< scatter beyond which an edge is sought, see LocalFitter::fit_along_edges()
  bool borrow = false;   ///< see fit_cells()
};

/// Fits to the cells (i * pitch, j * pitch).
Image<LocalFit> fit_lattice(const Image<CellMean>& cells, double cell_mm, int pitch, const LocalFitOptions& options);
Image<LocalFit> fit_lattice(const CellColumns& cells, double cell_mm, int pitch, const LocalFitOptions& options);

/// The same from a lattice of twice the pitch: blended where the surface is smooth, fitted elsewhere.
Image<LocalFit> refine_lattice(const Image<LocalFit>& coarse, const Image<CellMean>& cells, double cell_mm, int pitch,
                               const LocalFitOptions& options);

/// A fit at each cell. Most come from a lattice of every third cell of either axis, much finer than a neighbourhood:
/// where all is smooth, the surrounding fits are blended; other cells are fitted one by one. At an edge that takes ten
/// windows; if one may `borrow`, a cell takes the one of the surrounding fits that its own points agree with best.
/// \param wanted  which cells; others remain without
Image<LocalFit> fit_cells(const Image<CellMean>& cells, double cell_mm, const LocalFitOptions& options,
                          const Image<std::uint8_t>& wanted);

}  // namespace pagesweep
