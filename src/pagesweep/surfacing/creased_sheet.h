// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "pagesweep/base/image.h"
#include "pagesweep/surfacing/local_fit.h"

namespace pagesweep {

struct CreaseOptions {
  double smoothing_mm = 2;               ///< width over which heights are averaged where the sheet hardly bends
  double sharp_curvature_per_mm = 0.01;  ///< beyond it bending costs by its angle alone, however sharp it is
  int rounds = 6;                        ///< of reweighting
};

/// Heights of a sheet of paper with creases on the grid of cells:
///
///     sum_i w_i rho (b_i z - z_i)^2 + tau h^2 sum_k |H_k|_*   -> min
///
/// with the cells' mean heights z_i (b_i: bilinear at the mean place of a cell's points) and the nuclear norm of the
/// Hessian, the sum of its singular values. Paper bends in one direction at a place, its Hessian has rank one; this
/// norm prefers just that, and as it is of first order it lets all bending of a crease happen in one place. Below
/// `sharp_curvature_per_mm` it is rounded to a quadratic. Solved by iteratively reweighted least squares with conjugate
/// gradients.
///
/// \param cells   a page's cells; weight 0 where nothing was measured
/// \param base    [mm] heights that belong to z beside the unknown: z = base + result; the cells' z are against base
/// \param within  cells that get a height
/// \param start   [mm] first guess of the result, kept where `within` is 0
Image<double> fit_creased_sheet(const Image<CellMean>& cells, const Image<double>& base, double cell_mm,
                                double noise_factor, const Image<std::uint8_t>& within, const Image<double>& start,
                                const CreaseOptions& options = {});

}  // namespace pagesweep
