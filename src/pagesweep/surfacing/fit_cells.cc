// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <span>

#include "pagesweep/base/parallel.h"
#include "pagesweep/surfacing/local_fit.h"

namespace pagesweep {
namespace {

constexpr int fit_pitch = 3;  // [cells]
constexpr double agreement_sigmas = 2;

/// A lattice fit near a cell, seen from that cell.
struct Neighbour {
  LocalFit fit;
  double share;  ///< bilinear weight
};

/// The fits at the corners of the lattice square that holds cell (i, j).
class Surroundings {
 public:
  Surroundings(const Image<LocalFit>& lattice, int pitch, double cell_mm, int i, int j) {
    const int i0 = i / pitch, j0 = j / pitch;
    const double a = double(i % pitch) / pitch, b = double(j % pitch) / pitch;
    for (const int dj : {0, 1})
      for (const int di : {0, 1}) {
        const double share = (di ? a : 1 - a) * (dj ? b : 1 - b);
        if (share == 0) continue;
        if (!lattice.contains(i0 + di, j0 + dj) || !lattice(i0 + di, j0 + dj).ok) {
          complete_ = false;
          continue;
        }
        const double u = (i - (i0 + di) * pitch) * cell_mm, v = (j - (j0 + dj) * pitch) * cell_mm;
        neighbours_[count_++] = {lattice(i0 + di, j0 + dj).moved(u, v), share};
      }
  }

  std::span<const Neighbour> all() const { return {neighbours_.data(), count_}; }
  bool are_smooth(double too_much) const {
    return complete_ &&
           std::ranges::all_of(all(), [&](const Neighbour& n) { return !n.fit.at_edge && n.fit.scatter < too_much; });
  }
  LocalFit blended() const {
    LocalFit sum;
    sum.ok = true;
    for (const auto& [fit, share] : all()) {
      sum.z += share * fit.z;
      sum.sigma += share * fit.sigma;
      sum.scatter += share * fit.scatter;
      sum.scatter_mm += share * fit.scatter_mm;
      for (std::size_t k = 0; k < sum.slopes.size(); ++k) sum.slopes[k] += share * fit.slopes[k];
    }
    return sum;
  }

 private:
  std::array<Neighbour, 4> neighbours_{};
  std::size_t count_ = 0;
  bool complete_ = true;
};

/// How far a cell's mean lies off a fit around it, in standard deviations.
double disagreement(const CellMean& cell, const LocalFit& fit) {
  const double averaged =
      fit.at(cell.p, cell.q) + fit.slopes[2] * cell.pp + fit.slopes[3] * cell.pq + fit.slopes[4] * cell.qq;
  const double scatter = std::max(1.0, fit.scatter);
  return std::abs(cell.z - averaged) / (scatter * std::sqrt(1 / cell.weight + fit.sigma * fit.sigma));
}

/// What the lattice tells about a cell that holds points; not ok if that is not enough.
LocalFit look_up(const Surroundings& surroundings, const CellMean& cell, const LocalFitOptions& options) {
  if (surroundings.are_smooth(options.too_much)) return surroundings.blended();
  LocalFit best;
  if (!options.borrow) return best;
  double least = agreement_sigmas;
  for (const auto& [fit, share] : surroundings.all())
    if (const double d = disagreement(cell, fit); d < least && fit.scatter < options.too_much) {
      least = d;
      best = fit;
    }
  return best;
}

}  // namespace

LocalFit LocalFit::moved(double u, double v) const {
  LocalFit fit = *this;
  fit.z = at(u, v);
  fit.slopes[0] += 2 * slopes[2] * u + slopes[3] * v;
  fit.slopes[1] += slopes[3] * u + 2 * slopes[4] * v;
  return fit;
}

Image<LocalFit> fit_lattice(const Image<CellMean>& cells, double cell_mm, int pitch, const LocalFitOptions& options) {
  return fit_lattice(CellColumns(cells), cell_mm, pitch, options);
}

Image<LocalFit> fit_lattice(const CellColumns& cells, double cell_mm, int pitch, const LocalFitOptions& options) {
  Image<LocalFit> fits((cells.width - 1) / pitch + 1, (cells.height - 1) / pitch + 1, LocalFit());
  parallel_rows(fits.height(), [&](int j) {
    LocalFitter fitter(cells, cell_mm);
    for (int i = 0; i < fits.width(); ++i)
      fits(i, j) = fitter.fit_along_edges(i * pitch, j * pitch, options.radius_mm, options.steps, options.too_much);
  });
  return fits;
}

Image<LocalFit> refine_lattice(const Image<LocalFit>& coarse, const Image<CellMean>& cells, double cell_mm, int pitch,
                               const LocalFitOptions& options) {
  const CellColumns columns(cells);
  Image<LocalFit> fits((cells.width() - 1) / pitch + 1, (cells.height() - 1) / pitch + 1, LocalFit());
  parallel_rows(fits.height(), [&](int j) {
    LocalFitter fitter(columns, cell_mm);
    for (int i = 0; i < fits.width(); ++i) {
      const Surroundings surroundings(coarse, 2 * pitch, cell_mm, i * pitch, j * pitch);
      fits(i, j) =
          surroundings.are_smooth(options.too_much)
              ? surroundings.blended()
              : fitter.fit_along_edges(i * pitch, j * pitch, options.radius_mm, options.steps, options.too_much);
    }
  });
  return fits;
}

Image<LocalFit> fit_cells(const Image<CellMean>& cells, double cell_mm, const LocalFitOptions& options,
                          const Image<std::uint8_t>& wanted) {
  const CellColumns columns(cells);
  const Image<LocalFit> lattice = fit_lattice(columns, cell_mm, fit_pitch, options);
  Image<LocalFit> fits(cells.width(), cells.height(), LocalFit());
  parallel_rows(fits.height(), [&](int j) {
    LocalFitter fitter(columns, cell_mm);
    for (int i = 0; i < fits.width(); ++i) {
      if (!wanted(i, j)) continue;
      if (cells(i, j).weight > 0)
        fits(i, j) = look_up(Surroundings(lattice, fit_pitch, cell_mm, i, j), cells(i, j), options);
      if (!fits(i, j).ok) fits(i, j) = fitter.fit_along_edges(i, j, options.radius_mm, options.steps, options.too_much);
    }
  });
  return fits;
}

}  // namespace pagesweep
