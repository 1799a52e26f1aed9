// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>

namespace pagesweep {

/// One gray value sequence as a shifted, scaled copy of another: a f(k) + b = g(c + k).
struct Shift {
  double a = 1;             ///< multiplicative adaptation
  double b = 0;             ///< additive adaptation [gray values]
  double c = 0;             ///< time value tau(g, f) [frames]: g comes this much later than f
  double sigma = 0;         ///< of c [frames], from the residuals
  double residual_rms = 0;  ///< [gray values] of the rows
  int rows = 0;             ///< rows that took part
};

/// Eq. 8 and 9 of Lilienblum et al. 2009: least squares over the rows k = 0 ... f.size() - 1
///     [f_k  1  g_{k+1} - g_k] . [a  b  x] = g_k - c~ (g_{k+1} - g_k),   g_k = g[c~ + k].
/// Comparison with eq. 7 shows that the third unknown of the printed matrix is x = -c; the sign is put right here.
///
/// A row of which f_k, g_k or g_{k+1} is not finite (dropped: NaN, clipped: infinity) or outside g is skipped. For a
/// plateau these are the rows that eq. 10-11 skip, with the interval's ends taken as the last and first good samples.
/// \param start  c~ [frames]
/// \return nothing if fewer than 4 rows are left or they do not determine c
std::optional<Shift> solve_shift(std::span<const float> f, std::span<const float> g, int start);

/// solve_shift() with c~ moved to where the residuals are smallest: the solution of eq. 3. There c~ <= c < c~ + 1, so
/// that eq. 4 interpolates, up to what noise does at a frame's border. It is not enough to repeat with c~ = floor(c)
/// until that holds: the noise in the matrix draws c towards c~, and a dark bell may hold a start value that is frames
/// off.
std::optional<Shift> refine_shift(std::span<const float> f, std::span<const float> g, int start);

/// c~ from the peak positions of both sequences; a clipped plateau counts as a peak in its middle.
int start_shift(std::span<const float> f, std::span<const float> g);

/// Index of the highest sample, the middle one of a clipped run. \return -1 if no sample is valid
int peak_position(std::span<const float> samples);

}  // namespace pagesweep
