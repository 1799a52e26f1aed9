// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "pagesweep/data/transfer_curve.h"

namespace pagesweep {

/// Rows of pixels are worked on in steps of so many.
constexpr std::size_t gain_row_step = 16;
/// Stands for the gain of a sample that is not to be changed.
constexpr float left_alone = -1;

/// What turns samples into light, and light into samples.
struct ToneTables {
  ToneTables(const TransferCurve& curve, int bit_depth);

  int cells;                   ///< a thousandth of a gray value is enough, and a table that a core has at hand is fast
  std::vector<float> light;    ///< of every sample
  std::vector<float> samples;  ///< of the light (k / cells)^2: steps are fine where curves are steep
};

/// The gains of a row of pixels, between nodes linear.
/// \param nodes  the row of the grid that runs through the pixels' middles, for each of one or three channels
/// \param shown  a multiple of gain_row_step; NaN where a pixel is to be left alone
/// \param gains  of each pixel's channels side by side
void spread_gains(std::span<const std::vector<float>> nodes, float nodes_per_px, std::span<const float> shown,
                  std::span<float> gains);

/// Multiplies each sample's light by its gain.
/// \param samples  a multiple of gain_row_step
void multiply_light(const ToneTables& tones, std::span<const float> gains, std::span<std::uint8_t> samples);
void multiply_light(const ToneTables& tones, std::span<const float> gains, std::span<std::uint16_t> samples);

}  // namespace pagesweep
