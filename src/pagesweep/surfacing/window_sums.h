// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <vector>

namespace pagesweep {

/// The cells of one neighbourhood, one column an attribute, so that vectors hold neighbouring cells. Positions are over
/// the neighbourhood's radius.
struct Window {
  std::vector<float> u, v, uu, uv, vv;  ///< the paraboloid's terms, averaged over each cell
  std::vector<float> z;                 ///< [mm] against some height near all of them: floats are short
  std::vector<float> weight;            ///< [1/mm^2]
  std::vector<float> kernel;            ///< by distance
  std::vector<float> robust;            ///< by residual
  std::vector<float> residual;          ///< |z - fit| over what weight promises
  std::size_t size = 0;
  double z0_mm = 0;  ///< that height

  void reserve(std::size_t cells);
  /// To be called after the last cell: whole vectors are read, and cells beyond the last one weigh nothing.
  void pad();

 private:
  static constexpr std::size_t slack = 8;
};

/// The normal equations sum_i w_i x_i x_i' c = sum_i w_i z_i x_i with rows x = (1, u, v, uu, uv, vv) and
/// w = weight kernel robust.
struct WindowSums {
  /// Upper triangle, row by row. Element 0 is the sum of w.
  std::array<double, 21> a{};
  std::array<double, 6> b{};
};
WindowSums add_up(const Window& window);

/// Puts |z - fit| sqrt(weight) into window.residual.
/// \param coefficients  of (1, u, v, uu, uv, vv)
void find_residuals(const std::array<float, 6>& coefficients, Window& window);

/// Median of window.residual, to a two-thousandth of their mean.
double median_residual(const Window& window);

/// Puts weights by residual / unit into window.robust: Tukey's biweight, or those of least absolute values beyond 1.
void weigh_residuals(double unit, bool redescending, Window& window);

/// sum_i (kernel_i robust_i x_i . influence)^2 weight_i
double sum_of_influence(const std::array<float, 6>& influence, const Window& window);

}  // namespace pagesweep
