// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace pagesweep {

/// sums[x] = factor * (sum over the rows of row[left + x]). Sums before the factor stay below 2^16 for 8 bit, 2^24 for
/// 16 bit: at most 256 rows.
void sum_rows(std::span<const std::uint8_t* const> rows, int left, float factor, std::span<float> sums);
void sum_rows(std::span<const std::uint16_t* const> rows, int left, float factor, std::span<float> sums);

/// responses[x] = 2 middle[x] - sides[x], and where that exceeds rise[x] it replaces it, and `index` best[x].
struct BlockRows {
  const float* middle[2];
  const float* side[4];
};
void keep_highest(const BlockRows& rows, std::int32_t index, std::span<float> responses, std::span<float> rise,
                  std::span<std::int32_t> best);

inline constexpr int tile_pixels = 16;

/// The samples of 16 neighbouring pixels in the order of time: out[p * stride + i] = row_i[left + p] - black.
/// \param stride  of out; at least the number of rows, rounded up to a multiple of 16
/// \param most    [tile_pixels] becomes each pixel's highest gray value
void transpose_rows(std::span<const std::uint8_t* const> rows, int left, float black, float* out, std::size_t stride,
                    float* most);
void transpose_rows(std::span<const std::uint16_t* const> rows, int left, float black, float* out, std::size_t stride,
                    float* most);

}  // namespace pagesweep
