// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/surfacing/differences.h"

#include <algorithm>
#include <cmath>

#include "pagesweep/base/parallel.h"
#include "pagesweep/surfacing/flatten.h"

namespace pagesweep {
namespace {

constexpr double ease_mm = 15;
constexpr double model_noise_mm = 0.02;

Support support_of(const HeightField& field, const CellMean& cell, int i, int j) {
  Support place;
  place.plan = {field.p_of(i) + cell.p, field.q_of(j) + cell.q};
  place.z = cell.z;
  // Neighbouring points err alike to some degree, so that no cell is worth more than this.
  place.weight = 1 / (field.noise_factor * field.noise_factor / cell.weight + model_noise_mm * model_noise_mm);
  place.covariance << cell.pp, cell.pq, cell.pq, cell.qq;
  return place;
}

/// Cells in or within two cells of the page.
Image<std::uint8_t> widen(const Image<CellMean>& page) {
  Image<std::uint8_t> wide(page.width(), page.height(), 0);
  for (int j = 0; j < page.height(); ++j)
    for (int i = 0; i < page.width(); ++i)
      if (page(i, j).weight > 0)
        for (int dj = -2; dj <= 2; ++dj)
          for (int di = -2; di <= 2; ++di)
            if (wide.contains(i + di, j + dj)) wide(i + di, j + dj) = 1;
  return wide;
}

/// Cells without a measurement, row by row, as far from the measured ones as the membrane reaches.
std::vector<std::pair<int, int>> cells_to_ease(const Image<std::uint8_t>& known, double cell_mm) {
  const int reach = static_cast<int>(2 * ease_mm / cell_mm) + 1;
  int i0 = known.width(), i1 = -1, j0 = known.height(), j1 = -1;
  for (int j = 0; j < known.height(); ++j)
    for (int i = 0; i < known.width(); ++i)
      if (known(i, j)) {
        i0 = std::min(i0, i);
        i1 = std::max(i1, i);
        j0 = std::min(j0, j);
        j1 = j;
      }
  std::vector<std::pair<int, int>> cells;
  for (int j = std::max(0, j0 - reach); j <= std::min(known.height() - 1, j1 + reach); ++j)
    for (int i = std::max(0, i0 - reach); i <= std::min(known.width() - 1, i1 + reach); ++i)
      if (!known(i, j)) cells.emplace_back(i, j);
  return cells;
}

/// Fills the cells around the measured ones with the solution of a screened membrane, laplace(dz) = dz / ease^2, that
/// hangs from them: it goes on smoothly and eases to 0.
void ease_out(Image<double>& dz, const Image<std::uint8_t>& known, double cell_mm) {
  const double screen = 4 + std::pow(cell_mm / ease_mm, 2);
  const double relaxation = 1.7;
  const auto cells = cells_to_ease(known, cell_mm);
  for (int sweep = 0; sweep < 60; ++sweep)
    for (const auto& [i, j] : cells) {
      const double sum = (i > 0 ? dz(i - 1, j) : 0) + (i + 1 < dz.width() ? dz(i + 1, j) : 0) +
                         (j > 0 ? dz(i, j - 1) : 0) + (j + 1 < dz.height() ? dz(i, j + 1) : 0);
      dz(i, j) += relaxation * (sum / screen - dz(i, j));
    }
}

}  // namespace

double Differences::at(double p_mm, double q_mm) const {
  const double i = field->i_of(p_mm), j = field->j_of(q_mm);
  if (!(i >= 0 && j >= 0 && i <= dz.width() - 1 && j <= dz.height() - 1)) return 0;
  return interpolate_nodes(dz, i, j);
}

std::vector<Support> places_of(const HeightField& field, const Image<CellMean>& cells) {
  std::vector<Support> places;
  for (int j = 0; j < field.rows(); ++j)
    for (int i = 0; i < field.columns(); ++i)
      if (cells(i, j).weight > 0) places.push_back(support_of(field, cells(i, j), i, j));
  return places;
}

Differences measure_differences(const HeightField& field, const Image<CellMean>& cells, const RuledSurface& model,
                                double radius_mm) {
  Image<CellMean> gaps = cells;
  for (int j = 0; j < field.rows(); ++j)
    for (int i = 0; i < field.columns(); ++i) {
      if (!(cells(i, j).weight > 0)) continue;
      const Support place = support_of(field, cells(i, j), i, j);
      gaps(i, j).z = static_cast<float>(place.z - height_over(model, place));
    }
  Differences differences{&field, Image<double>(field.columns(), field.rows(), 0),
                          Image<float>(field.columns(), field.rows(), not_a_number), field.status};
  const Image<std::uint8_t> wide = widen(cells);
  Image<std::uint8_t> known(field.columns(), field.rows(), 0);
  const LocalFitOptions options{std::max(radius_mm, 2.5 * field.cell_mm), 2, 2.5 * std::max(1.0, field.noise_factor)};
  const Image<LocalFit> fits = fit_cells(gaps, field.cell_mm, options, wide);
  parallel_rows(field.rows(), [&](int j) {
    for (int i = 0; i < field.columns(); ++i) {
      // A height that was measured but does not belong to this page is off its surface.
      PixelStatus& status = differences.status(i, j);
      if (status == PixelStatus::ok) status = PixelStatus::off_surface;
      const LocalFit& fit = fits(i, j);
      if (!fit.ok) continue;
      differences.dz(i, j) = fit.z;
      differences.sigma(i, j) = static_cast<float>(fit.sigma * std::max(field.noise_factor, fit.scatter));
      status = PixelStatus::ok;
      known(i, j) = 1;
    }
  });
  ease_out(differences.dz, known, field.cell_mm);
  return differences;
}

Eigen::Vector3d measured_above(const RuledSurface& model, const Differences& differences, const Eigen::Vector3d& point,
                               const Eigen::Vector3d& normal) {
  Eigen::Vector3d above = point;
  // Newton's method along the normal; the derivative is that of the model.
  for (int step = 0; step < 4; ++step) {
    const Eigen::Vector2d plan = above.head<2>();
    const double missing = model.height(plan) + differences.at(plan.x(), plan.y()) - above.z();
    above += missing * normal.z() * normal;
  }
  return above;
}

}  // namespace pagesweep
