// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/shift_equations.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace pagesweep {
namespace {

/// A^T A, A^T b and b^T b of eq. 9, as sums over the rows (f, 1, s) . x = y.
struct NormalEquations {
  double ff = 0, f1 = 0, fs = 0, s1 = 0, ss = 0, fy = 0, y1 = 0, sy = 0, yy = 0;
  int rows = 0;

  void add(double f, double s, double y) {
    ff += f * f, f1 += f, fs += f * s, s1 += s, ss += s * s;
    fy += f * y, y1 += y, sy += s * y, yy += y * y;
    ++rows;
  }
  Eigen::Matrix3d matrix() const { return Eigen::Matrix3d{{ff, f1, fs}, {f1, double(rows), s1}, {fs, s1, ss}}; }
  Eigen::Vector3d right() const { return {fy, y1, sy}; }
};

}  // namespace

std::optional<Shift> solve_shift(std::span<const float> f, std::span<const float> g, int start) {
  constexpr int fewest_rows = 4;  // 3 unknowns and something left to judge them by
  const int first = std::max(0, -start);
  const int last = std::min(static_cast<int>(f.size()), static_cast<int>(g.size()) - 1 - start);
  NormalEquations equations;
  for (int k = first; k < last; ++k) {
    const float f_k = f[static_cast<std::size_t>(k)];
    const float g_k = g[static_cast<std::size_t>(start + k)];
    const float step = g[static_cast<std::size_t>(start + k + 1)] - g_k;
    if (std::isfinite(f_k) && std::isfinite(g_k) && std::isfinite(step))
      equations.add(f_k, step, g_k - static_cast<double>(start) * step);
  }
  if (equations.rows < fewest_rows) return std::nullopt;
  const Eigen::LDLT<Eigen::Matrix3d> solver(equations.matrix());
  const Eigen::Vector3d x = solver.solve(equations.right());
  const double variance_factor = solver.solve(Eigen::Vector3d::UnitZ()).z();
  // No usable gray value has a relative precision of 1e-9: beyond that the rows say nothing about c.
  if (!x.allFinite() || !(variance_factor > 0) || solver.rcond() < 1e-14) return std::nullopt;
  const double left = std::max(0.0, equations.yy - x.dot(equations.right()));
  // A residual is (1 - q) n_k + q n_{k+1}, q = c - c~: over all q, on average 2/3 of a sample's variance. And the noise
  // in the column of differences, twice that variance a row, passes for slope: it makes c look more certain than it is.
  const double variance = 1.5 * left / (equations.rows - 3);
  const double slopes = std::max(1 / variance_factor - 2 * variance * equations.rows, 0.05 / variance_factor);
  return Shift{.a = x(0),
               .b = x(1),
               .c = -x(2),
               .sigma = std::sqrt(variance / slopes),
               .residual_rms = std::sqrt(left / equations.rows),
               .rows = equations.rows};
}

std::optional<Shift> refine_shift(std::span<const float> f, std::span<const float> g, int start) {
  constexpr int most_steps = 30;
  std::optional<Shift> best = solve_shift(f, g, start);
  for (int step = 0; best && step < most_steps; ++step) {
    const int reach = static_cast<int>(f.size());
    const int proposed = std::clamp(static_cast<int>(std::floor(best->c)), start - reach, start + reach);
    int next = start;
    for (const int candidate : {proposed, start - 1, start + 1}) {
      if (candidate == start || candidate == next) continue;
      const auto shift = solve_shift(f, g, candidate);
      if (!shift || shift->residual_rms >= best->residual_rms) continue;
      best = shift;
      next = candidate;
    }
    if (next == start) break;
    start = next;
  }
  return best;
}

int peak_position(std::span<const float> samples) {
  int first = -1, last = -1;
  for (int i = 0; i < static_cast<int>(samples.size()); ++i) {
    const float sample = samples[static_cast<std::size_t>(i)];
    if (std::isnan(sample)) continue;
    if (first < 0 || sample > samples[static_cast<std::size_t>(first)]) first = last = i;
    if (sample == samples[static_cast<std::size_t>(first)]) last = i;
  }
  return first < 0 || !std::isinf(samples[static_cast<std::size_t>(first)]) ? first : (first + last) / 2;
}

int start_shift(std::span<const float> f, std::span<const float> g) { return peak_position(g) - peak_position(f); }

}  // namespace pagesweep
