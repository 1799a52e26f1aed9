// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/surfacing/local_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace pagesweep {
namespace {

/// Variance of the fitted height over that of the weighted mean: about 4 within a window full of cells, 16 at a
/// straight border, and growing without bound where the fit extrapolates. A paraboloid gives way to a plane before
/// that.
constexpr double largest_leverage = 40, largest_leverage_of_paraboloid = 24;

template <int Terms>
std::array<float, 6> narrow(const Eigen::Matrix<double, Terms, 1>& coefficients) {
  std::array<float, 6> narrowed{};
  for (int k = 0; k < Terms; ++k) narrowed[static_cast<std::size_t>(k)] = static_cast<float>(coefficients(k));
  return narrowed;
}

}  // namespace

template <int Terms>
LocalFit LocalFitter::solve(double radius_mm, int steps) {
  using Vector = Eigen::Matrix<double, Terms, 1>;
  using Matrix = Eigen::Matrix<double, Terms, Terms>;
  LocalFit fit;
  if (window_.size < 2 * Terms) return fit;
  std::fill_n(window_.robust.begin(), window_.size, 1.0f);
  const double freedom = 1 - static_cast<double>(Terms) / static_cast<double>(window_.size);
  Vector solution = Vector::Zero();
  Eigen::LLT<Matrix> normal_equations(Matrix::Identity());
  double total = 0;
  for (int step = 0; step <= steps; ++step) {
    const WindowSums sums = add_up(window_);
    Matrix a;
    for (int row = 0, at = 0; row < 6; ++row)
      for (int column = row; column < 6; ++column, ++at)
        if (column < Terms) a(row, column) = a(column, row) = sums.a[static_cast<std::size_t>(at)];
    total = sums.a[0];
    normal_equations.compute(a);
    const auto pivots = normal_equations.matrixLLT().diagonal();  // their roots
    if (normal_equations.info() != Eigen::Success || !(pivots.minCoeff() > 3e-5 * pivots.maxCoeff())) return fit;
    solution = normal_equations.solve(Eigen::Map<const Vector>(sums.b.data()));
    if (step == steps && steps > 0) break;
    find_residuals(narrow(solution), window_);
    fit.scatter = 1.4826 * median_residual(window_) / std::sqrt(std::max(0.1, freedom));
    weigh_residuals(std::max(1.0, fit.scatter), 2 * step >= steps, window_);
  }
  const Vector influence = normal_equations.solve(Vector::Unit(0));
  if (!(influence(0) * total < (Terms == 6 ? largest_leverage_of_paraboloid : largest_leverage))) return fit;
  double weights = 0;
  for (std::size_t k = 0; k < window_.size; ++k) weights += window_.weight[k];
  fit.ok = true;
  fit.z = window_.z0_mm + solution(0);
  fit.sigma = std::sqrt(sum_of_influence(narrow(influence), window_));
  fit.scatter_mm = fit.scatter / std::sqrt(weights / static_cast<double>(window_.size));
  for (int i = 1; i < Terms; ++i)
    fit.slopes[static_cast<std::size_t>(i - 1)] = solution(i) / (i < 3 ? radius_mm : radius_mm * radius_mm);
  return fit;
}

LocalFit LocalFitter::fit(int column, int row, const Neighbourhood& neighbourhood, int steps) {
  const double nearest_mm = gather(
      cells_, {column, row, cell_mm_, neighbourhood.radius_mm, neighbourhood.towards.x(), neighbourhood.towards.y()},
      window_);
  // A fit may bridge a gap of a few cells, not more.
  if (window_.size == 0 || nearest_mm > std::max(0.35 * neighbourhood.radius_mm, 1.5 * cell_mm_)) return {};
  if (const LocalFit paraboloid = solve<6>(neighbourhood.radius_mm, steps); paraboloid.ok) return paraboloid;
  return solve<3>(neighbourhood.radius_mm, steps);
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
  best.at_edge = true;
  return best;
}

}  // namespace pagesweep
