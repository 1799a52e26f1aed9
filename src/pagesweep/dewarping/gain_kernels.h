// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "pagesweep/base/image.h"
#include "pagesweep/data/transfer_curve.h"

namespace pagesweep {

/// Rows of pixels are worked on in steps of so many.
constexpr std::size_t gain_row_step = 16;
/// Stands for the gain of a sample that is not to be changed.
constexpr float left_alone = -1;

/// What turns samples into light, and light into samples.
struct ToneTables {
  static constexpr int cells = 1 << 14;

  ToneTables(const TransferCurve& curve, int bit_depth);

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
void multiply_light(const ToneTables& tones, std::span<const float> gains, std::span<std::uint16_t> samples);

/// The same for samples of 8 bit: what becomes of each for gains in small steps, looked up. A step is 1/4096 of the
/// least gain, which moves a sample by less than a thirtieth of a gray value.
class ByteTones {
 public:
  /// \param least_gain, most_gain  of all that will be asked for
  ByteTones(const ToneTables& tones, float least_gain, float most_gain);
  void multiply_light(std::span<const float> gains, std::span<std::uint8_t> samples) const;

 private:
  float first_, steps_per_gain_;
  Image<std::uint8_t> shown_;  ///< a row a sample: left alone, then by gain, which changes little from pixel to pixel
};

}  // namespace pagesweep
