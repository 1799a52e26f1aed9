// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "pagesweep/surfacing/ruled_surface.h"
#include "pagesweep/surfacing/smooth_points.h"

namespace pagesweep {

/// How far the measured surface lies above a model, smoothed: dz(p, q) [mm] on the grid of a height field.
struct Differences {
  const HeightField* field = nullptr;  ///< the grid; must outlive this
  int finer = 1;                       ///< nodes of dz a cell, along either axis
  Image<CellMean> gaps;                ///< the page's cells, their z against the model
  Image<std::uint8_t> known;           ///< cells whose height is measured
  Image<double> dz;  ///< [mm] everywhere, node (finer i, finer j) in the middle of cell (i, j); away from measurements
                     ///< it eases to 0 within some 15 mm
  Image<float> sigma;           ///< [mm] its standard deviation; NaN where it is not measured
  Image<PixelStatus> status;    ///< whether it is measured, else why not
  Image<float> cover_mm;        ///< height of what stands above the sheet; NaN where nothing does
  double beside_gutter_mm = 0;  ///< so near to ruling 0 points of both pages mix, and nothing is said to stand above

  double at(double p_mm, double q_mm) const;
};

/// The measured places of a page.
/// \param cells  the field's cells as far as they belong to the page
std::vector<Support> places_of(const HeightField& field, const Image<CellMean>& cells);

/// Local robust fits to the differences between a page's cells and the model. What the model takes away, the page's
/// bend, the neighbourhood need not follow; dents remain, and the other page stays out of it.
/// \param has_gutter  whether the page ends at ruling 0, where the facing one begins
Differences measure_differences(const HeightField& field, const Image<CellMean>& cells, const RuledSurface& model,
                                double radius_mm, bool has_gutter = false);

/// The same differences with sharp creases: the sheet that fit_creased_sheet() lays through the cells.
Differences crease_differences(const Differences& differences, const RuledSurface& model, double radius_mm);

/// The measured point orthogonally above a point of the model.
/// \param point, normal  plan coordinates; the normal is of unit length and points up
Eigen::Vector3d measured_above(const RuledSurface& model, const Differences& differences, const Eigen::Vector3d& point,
                               const Eigen::Vector3d& normal);

}  // namespace pagesweep
