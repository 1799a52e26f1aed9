// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/surfacing/local_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace pagesweep {
namespace {

/// Tukey's biweight keeps 95 % efficiency under Gaussian noise with this cut-off.
constexpr double tukey_cutoff = 4.685;
/// Variance of the fitted height over that of the weighted mean: about 4 within a window full of cells, 16 at a
/// straight border, and growing without bound where the fit extrapolates. A paraboloid gives way to a plane before
/// that.
constexpr double largest_leverage = 40, largest_leverage_of_paraboloid = 24;

template <int Terms, class Sample>
Eigen::Matrix<double, Terms, 1> design_row(const Sample& s) {
  Eigen::Matrix<double, Terms, 1> row;
  if constexpr (Terms == 6)
    row << 1, s.u, s.v, s.uu, s.uv, s.vv;
  else
    row << 1, s.u, s.v;
  return row;
}

double median_of(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

void LocalFitter::gather(int column, int row, const Window& window) {
  samples_.clear();
  const int reach = static_cast<int>(window.radius_mm / cell_mm_) + 1;
  const bool one_sided = window.towards.squaredNorm() > 0;
  double nearest = window.radius_mm * window.radius_mm;
  for (int j = std::max(0, row - reach); j <= std::min(cells_.height() - 1, row + reach); ++j)
    for (int i = std::max(0, column - reach); i <= std::min(cells_.width() - 1, column + reach); ++i) {
      const CellMean& cell = cells_(i, j);
      if (!(cell.weight > 0)) continue;
      const double u = (i - column) * cell_mm_ + cell.p, v = (j - row) * cell_mm_ + cell.q;
      const double d2 = (u * u + v * v) / (window.radius_mm * window.radius_mm);
      if (d2 >= 1) continue;
      if (one_sided && u * window.towards.x() + v * window.towards.y() < -0.75 * cell_mm_) continue;
      nearest = std::min(nearest, u * u + v * v);
      const double r = window.radius_mm;
      samples_.push_back({u / r, v / r, (u * u + cell.pp) / (r * r), (u * v + cell.pq) / (r * r),
                          (v * v + cell.qq) / (r * r), cell.z, cell.weight, (1 - d2) * (1 - d2), 1});
    }
  nearest_mm_ = std::sqrt(nearest);
}

template <int Terms>
double LocalFitter::reweight(const Eigen::Matrix<double, Terms, 1>& solution, bool redescending) {
  residuals_.clear();
  for (Sample& s : samples_) {
    s.robust = std::abs(design_row<Terms>(s).dot(solution) - s.z) * std::sqrt(s.weight);  // for now
    residuals_.push_back(s.robust);
  }
  const double freedom = static_cast<double>(Terms) / static_cast<double>(samples_.size());
  const double scale = 1.4826 * median_of(residuals_) / std::sqrt(std::max(0.1, 1 - freedom));
  const double unit = std::max(1.0, scale);
  for (Sample& s : samples_) {
    const double x = s.robust / unit;
    if (redescending) {
      const double y = 1 - x * x / (tukey_cutoff * tukey_cutoff);
      s.robust = y > 0 ? y * y : 0;
    } else {
      s.robust = 1 / std::max(1.0, x);
    }
  }
  return scale;
}

template <int Terms>
LocalFit LocalFitter::solve(double radius_mm, int steps) {
  using Vector = Eigen::Matrix<double, Terms, 1>;
  using Matrix = Eigen::Matrix<double, Terms, Terms>;
  LocalFit fit;
  if (samples_.size() < 2 * Terms) return fit;
  Vector solution = Vector::Zero();
  Eigen::LDLT<Matrix> normal_equations;
  double total = 0;
  for (int step = 0; step <= steps; ++step) {
    Matrix a = Matrix::Zero();
    Vector b = Vector::Zero();
    total = 0;
    for (const Sample& s : samples_) {
      const double w = s.weight * s.kernel * s.robust;
      const Vector row = design_row<Terms>(s);
      const Vector weighted = w * row;
      a.noalias() += weighted * row.transpose();
      b += s.z * weighted;
      total += w;
    }
    normal_equations.compute(a);
    const auto pivots = normal_equations.vectorD();
    if (!(pivots.minCoeff() > 1e-9 * pivots.maxCoeff())) return fit;
    solution = normal_equations.solve(b);
    if (step < steps || steps == 0) fit.scatter = reweight<Terms>(solution, 2 * step >= steps);
  }
  const Vector influence = normal_equations.solve(Vector::Unit(0));
  double variance = 0, weights = 0;
  for (const Sample& s : samples_) {
    const double l = s.kernel * s.robust * design_row<Terms>(s).dot(influence);
    variance += l * l * s.weight;
    weights += s.weight;
  }
  if (!(influence(0) * total < (Terms == 6 ? largest_leverage_of_paraboloid : largest_leverage))) return fit;
  fit.ok = true;
  fit.z = solution(0);
  fit.sigma = std::sqrt(variance);
  fit.scatter_mm = fit.scatter / std::sqrt(weights / static_cast<double>(samples_.size()));
  for (int i = 1; i < Terms; ++i)
    fit.slopes[static_cast<std::size_t>(i - 1)] = solution(i) / (i < 3 ? radius_mm : radius_mm * radius_mm);
  return fit;
}

LocalFit LocalFitter::fit(int column, int row, const Window& window, int steps) {
  gather(column, row, window);
  // A fit may bridge a gap of a few cells, not more.
  if (samples_.empty() || nearest_mm_ > std::max(0.35 * window.radius_mm, 1.5 * cell_mm_)) return {};
  if (const LocalFit paraboloid = solve<6>(window.radius_mm, steps); paraboloid.ok) return paraboloid;
  for (Sample& s : samples_) s.robust = 1;
  return solve<3>(window.radius_mm, steps);
}

LocalFit LocalFitter::fit_along_edges(int column, int row, double radius_mm, int steps, double too_much) {
  LocalFit best = fit(column, row, {radius_mm}, steps);
  if (!best.ok || best.scatter < too_much) return best;
  const auto uncertainty = [](const LocalFit& f) { return f.sigma * std::max(1.0, f.scatter); };
  const auto offer = [&](const LocalFit& f) {
    if (f.ok && uncertainty(f) < uncertainty(best)) best = f;
  };
  offer(fit(column, row, {std::max(0.5 * radius_mm, 2.5 * cell_mm_)}, steps));
  for (int k = 0; k < 8; ++k) {
    const double angle = k * std::numbers::pi / 4;
    offer(fit(column, row, {radius_mm, {std::cos(angle), std::sin(angle)}}, steps));
  }
  return best;
}

}  // namespace pagesweep
