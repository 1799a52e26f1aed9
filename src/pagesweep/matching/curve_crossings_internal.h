// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>

#include "pagesweep/matching/sequence_search_internal.h"

namespace pagesweep {

/// Where some epipolar curves cross the other picture's pixel grid around some places, one entry a pixel: its columns
/// where a curve runs along the rows, its rows where it runs along the columns.
struct CrossingBatch {
  static constexpr int most = 16;
  static constexpr std::size_t crossings = 4;
  template <class T>
  using Each = std::array<T, most>;

  alignas(64) std::array<Each<double>, 3> direction{};  ///< of the pixels, see CurveFrame
  alignas(64) Each<double> inverse_depth{};             ///< [1/mm] of the places

  alignas(64) Each<double> known{};                   ///< 1 where the picture shows the place, else 0
  alignas(64) Each<double> along_rows{};              ///< 1 where the curve runs along the rows, else 0
  alignas(64) Each<double> first{};                   ///< column (or row) of the first crossing
  alignas(64) Each<double> at_first{};                ///< the other coordinate there
  alignas(64) Each<double> slope{};                   ///< its change a crossing
  alignas(64) Each<double> depth_at_first{}, step{};  ///< [1/mm] inverse depth there, and its change a crossing

  /// [pixel][crossing] The pixel before it, across the curve; and, in both halves, the share of the one behind [2^-15].
  alignas(64) std::array<std::int32_t, most * crossings> low{}, share{};
  alignas(64) std::array<Each<float>, crossings> noise_share{};  ///< what is left of the pixels' noise variance
};

/// The curves' tangents, and where they cross the grid around their places. Over three pixels no lens bends a curve by
/// more than a thousandth of a pixel.
void cross_grid(const CurveFrame& frame, int width, int height, CrossingBatch& batch);

/// Between which pixels four crossings lie, from first to slope.
void spread_crossings(int width, int height, CrossingBatch& batch);

}  // namespace pagesweep
