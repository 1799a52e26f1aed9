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

/// A place in the sequences and the sums of blocks of frames around it, a row each. The response there is twice the
/// middle less the sides.
struct Place {
  const float* middle[2];
  const float* side[4];
  std::int32_t number;
};
/// The highest response so far of each pixel in a row, and those beside it. NaN: there is none.
struct HighestRow {
  float* rise;         ///< the highest; minus infinity before the first
  float* before;       ///< the one before it
  float* after;        ///< the one after it
  std::int32_t* best;  ///< place of the highest
};
/// Looks at the next places of `count` pixels. The first of equal responses is the highest.
/// \param previous  the place before the first one; null: there is none
void keep_highest(const Place* previous, std::span<const Place> places, const HighestRow& highest, std::size_t count);

/// Of `count` pixels.
struct Extremes {
  float lowest_rise;
  std::int32_t latest_best;
};
Extremes extremes_of(const float* rise, const std::int32_t* best, std::size_t count);

/// Adds to counts[x] in how many rows row[x] >= saturation, up to 255.
void count_clipped_rows(std::span<const std::uint8_t* const> rows, std::uint8_t saturation,
                        std::span<std::uint8_t> counts);
void count_clipped_rows(std::span<const std::uint16_t* const> rows, std::uint16_t saturation,
                        std::span<std::uint8_t> counts);

inline constexpr int tile_pixels = 16;

/// The samples of 16 neighbouring pixels in the order of time: out[p * stride + i] = row_i[left + p].
/// \param stride  of out; at least the number of rows, rounded up to a multiple of 16
void transpose_rows(std::span<const std::uint8_t* const> rows, int left, std::uint8_t* out, std::size_t stride);
void transpose_rows(std::span<const std::uint16_t* const> rows, int left, std::uint16_t* out, std::size_t stride);

/// light[i] = gray[i] - black for `count` entries. \return the highest gray value
float take_off(const std::uint8_t* gray, std::size_t count, float black, float* light);
float take_off(const std::uint16_t* gray, std::size_t count, float black, float* light);

}  // namespace pagesweep
