// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/surfacing/differences.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "pagesweep/base/parallel.h"
#include "pagesweep/surfacing/creased_sheet.h"
#include "pagesweep/surfacing/flatten.h"

namespace pagesweep {
namespace {

constexpr double ease_mm = 15;
constexpr double coarse_cell_mm = 3;
constexpr double model_noise_mm = 0.02;
constexpr double least_cover_mm = 0.3;
constexpr double mixed_cells = 2;  // from the gutter: as far as a cell there, and its pixels' spots, reach over it

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

/// Cells of twice the size: known where one of the four is, and of the known ones' mean height.
std::pair<Image<double>, Image<std::uint8_t>> halve(const Image<double>& dz, const Image<std::uint8_t>& known) {
  Image<double> half((dz.width() + 1) / 2, (dz.height() + 1) / 2, 0);
  Image<std::uint8_t> half_known(half.width(), half.height(), 0);
  Image<double> counts = half;
  for (int j = 0; j < dz.height(); ++j)
    for (int i = 0; i < dz.width(); ++i)
      if (known(i, j)) {
        half(i / 2, j / 2) += dz(i, j);
        counts(i / 2, j / 2) += 1;
        half_known(i / 2, j / 2) = 1;
      }
  for (std::size_t k = 0; k < half.size(); ++k) half.data()[k] /= std::max(1.0, counts.data()[k]);
  return {std::move(half), std::move(half_known)};
}

/// Fills the cells around the measured ones with the solution of a screened membrane, laplace(dz) = dz / ease^2, that
/// hangs from them: it goes on smoothly and eases to 0. Larger cells, where heights spread in few steps, give the
/// start.
void ease_out(Image<double>& dz, const Image<std::uint8_t>& known, double cell_mm) {
  const double screen = 4 + std::pow(cell_mm / ease_mm, 2);
  const double relaxation = 1.7;
  const auto cells = cells_to_ease(known, cell_mm);
  int sweeps = 60;
  if (cell_mm < coarse_cell_mm) {
    auto [half, half_known] = halve(dz, known);
    ease_out(half, half_known, 2 * cell_mm);
    for (const auto& [i, j] : cells) dz(i, j) = interpolate_nodes(half, 0.5 * i - 0.25, 0.5 * j - 0.25);
    sweeps = 6;
  }
  for (int sweep = 0; sweep < sweeps; ++sweep)
    for (const auto& [i, j] : cells) {
      const double sum = (i > 0 ? dz(i - 1, j) : 0) + (i + 1 < dz.width() ? dz(i + 1, j) : 0) +
                         (j > 0 ? dz(i, j - 1) : 0) + (j + 1 < dz.height() ? dz(i, j + 1) : 0);
      dz(i, j) += relaxation * (sum / screen - dz(i, j));
    }
}

/// What was measured well above the sheet is not the sheet.
void find_cover(const RuledSurface& model, Differences& differences) {
  const HeightField& field = *differences.field;
  parallel_rows(field.rows(), [&](int j) {
    for (int i = 0; i < field.columns(); ++i) {
      if (differences.known(i, j) || !std::isfinite(field.z(i, j))) continue;
      const Eigen::Vector2d plan(field.p_of(i), field.q_of(j));
      if (std::abs(model.frame.ruling_from_plan(plan).x()) < differences.beside_gutter_mm) continue;
      const double sheet = model.height(plan) + differences.dz(differences.finer * i, differences.finer * j);
      if (!(field.z(i, j) - sheet > least_cover_mm)) continue;
      differences.status(i, j) = PixelStatus::covered;
      differences.cover_mm(i, j) = static_cast<float>(field.z(i, j) - sheet);
    }
  });
}

/// By how much cells scatter more than their points' sigma promises, from windows so small that creases hardly count.
double noise_factor_of(const Image<CellMean>& cells, double cell_mm) {
  constexpr int pitch = 5;
  constexpr double radius_cells = 2.5;
  const double no_edges = std::numeric_limits<double>::infinity();
  std::vector<double> scatters;
  const Image<LocalFit> fits = fit_lattice(cells, cell_mm, pitch, {radius_cells * cell_mm, 2, no_edges});
  for (const LocalFit& fit : fits.pixels())
    if (fit.ok) scatters.push_back(fit.scatter);
  if (scatters.empty()) return 1;
  // The lower quartile: most windows of a crumpled sheet hold a crease. Where none does, scatters of so few cells have
  // it at 0.87 of their median.
  const auto lower = scatters.begin() + static_cast<std::ptrdiff_t>(scatters.size() / 4);
  std::ranges::nth_element(scatters, lower);
  return std::max(0.1, *lower / 0.87);
}

/// The page's points in smaller cells, so that a crease has a place within a cell.
struct FineCells {
  static constexpr int finer = 2;

  FineCells(const Differences& differences, const RuledSurface& model) {
    const HeightField& field = *differences.field;
    const int columns = finer * (field.columns() - 1) + 1, rows = finer * (field.rows() - 1) + 1;
    gaps = Image<CellMean>(columns, rows);
    base = start = Image<double>(columns, rows, 0);
    within = Image<std::uint8_t>(columns, rows, 0);
    parallel_rows(rows, [&](int j) {
      for (int i = 0; i < columns; ++i) {
        const double u = double(i) / finer, v = double(j) / finer;
        start(i, j) = interpolate_nodes(differences.dz, u, v);
        within(i, j) = differences.known(static_cast<int>(std::lround(u)), static_cast<int>(std::lround(v)));
        if (within(i, j)) base(i, j) = model.height({field.p_of(u), field.q_of(v)});
      }
    });
    parallel_ranges(rows, 16, [&](int begin, int end) {
      std::vector<std::vector<PlanPoint>> row(static_cast<std::size_t>(columns));
      for (int j = begin; j < end; ++j) average_row(differences, model, j, row);
    });
  }

  Image<CellMean> gaps;
  Image<double> base, start;
  Image<std::uint8_t> within;

 private:
  /// \param row  has a place for the points of each cell
  void average_row(const Differences& differences, const RuledSurface& model, int j,
                   std::vector<std::vector<PlanPoint>>& row) {
    const HeightField& field = *differences.field;
    for (auto& points : row) points.clear();
    for (int y = j / finer; y <= (j + 1) / finer; ++y)  // the large cells that reach into this row
      for (int x = 0; x < field.columns(); ++x)
        if (y < field.rows() && differences.gaps(x, y).weight > 0) sort_points(differences, x, y, j, row);
    for (int i = 0; i < gaps.width(); ++i) {
      const auto& points = row[static_cast<std::size_t>(i)];
      if (points.empty()) continue;
      const double p_mm = field.p_of(double(i) / finer), q_mm = field.q_of(double(j) / finer);
      CellMean& cell = gaps(i, j) = mean_of(points, p_mm, q_mm);
      cell.z -= static_cast<float>(model.height({p_mm + double(cell.p), q_mm + double(cell.q)}));
    }
  }

  /// A cell on the gutter holds points of the other page as well: there its own mean has to do.
  static void sort_points(const Differences& differences, int x, int y, int j,
                          std::vector<std::vector<PlanPoint>>& row) {
    const HeightField& field = *differences.field;
    if (differences.gaps(x, y).count != field.cells(x, y).count) return;
    for (const PlanPoint& point : field.surface_points(x, y)) {
      const long i = std::lround(finer * field.i_of(point.p));
      if (std::lround(finer * field.j_of(point.q)) == j && i >= 0 && i < static_cast<long>(row.size()))
        row[static_cast<std::size_t>(i)].push_back(point);
    }
  }
};

}  // namespace

double Differences::at(double p_mm, double q_mm) const {
  const double i = finer * field->i_of(p_mm), j = finer * field->j_of(q_mm);
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
                                double radius_mm, bool has_gutter) {
  Differences differences{&field,
                          1,
                          cells,
                          Image<std::uint8_t>(field.columns(), field.rows(), 0),
                          Image<double>(field.columns(), field.rows(), 0),
                          Image<float>(field.columns(), field.rows(), not_a_number),
                          field.status,
                          Image<float>(field.columns(), field.rows(), not_a_number),
                          has_gutter ? mixed_cells * field.cell_mm : 0};
  Image<CellMean>& gaps = differences.gaps;
  for (int j = 0; j < field.rows(); ++j)
    for (int i = 0; i < field.columns(); ++i) {
      if (!(cells(i, j).weight > 0)) continue;
      const Support place = support_of(field, cells(i, j), i, j);
      gaps(i, j).z = static_cast<float>(place.z - height_over(model, place));
    }
  const Image<std::uint8_t> wide = widen(cells);
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
      differences.known(i, j) = 1;
    }
  });
  ease_out(differences.dz, differences.known, field.cell_mm);
  find_cover(model, differences);
  return differences;
}

Differences crease_differences(const Differences& differences, const RuledSurface& model, double radius_mm) {
  const HeightField& field = *differences.field;
  const FineCells fine(differences, model);
  Differences creased = differences;
  creased.finer = FineCells::finer;
  const double smoothing_mm = std::max(radius_mm, 2.5 * field.cell_mm) / 6;
  creased.dz = fit_creased_sheet(fine.gaps, fine.base, field.cell_mm / FineCells::finer,
                                 noise_factor_of(differences.gaps, field.cell_mm), fine.within, fine.start,
                                 {.smoothing_mm = smoothing_mm});
  find_cover(model, creased);
  return creased;
}

Eigen::Vector3d measured_above(const RuledSurface& model, const Differences& differences, const Eigen::Vector3d& point,
                               const Eigen::Vector3d& normal) {
  constexpr double near_mm = 1e-6;
  Eigen::Vector3d above = point;
  // Newton's method along the normal; the derivative is that of the model.
  for (int step = 0; step < 4; ++step) {
    const Eigen::Vector2d plan = above.head<2>();
    const double missing = model.height(plan) + differences.at(plan.x(), plan.y()) - above.z();
    above += missing * normal.z() * normal;
    if (std::abs(missing) < near_mm) break;
  }
  return above;
}

}  // namespace pagesweep
