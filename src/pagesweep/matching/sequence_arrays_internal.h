// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

namespace pagesweep {

/// Length of every stored sequence in its scalar product with itself, at most: products then fit into 32 bits.
inline constexpr int sequence_scale = (1 << 14) - 1;
/// Arrays that are filled whole vectors at a time have room for as much more than they need.
inline constexpr int score_padding = 16;

/// All sequences of a picture, two samples of 16 bits at a time. Lines are its rows, or its columns if the epipolar
/// curves run along those: places that follow each other on a curve follow each other in memory.
struct SequenceArrays {
  const std::int32_t* data;     ///< [line][pair of samples][place], the earlier sample in the lower half
  const std::int32_t* own;      ///< [line][place] scalar product of each sequence with itself
  const std::int32_t* squares;  ///< the same, larger where there is no sequence; null: sequence_scale^2 for all, about
  const std::int32_t* next;     ///< [line][place] scalar product with that of the next place
  int pairs;                    ///< of samples; the last one may be filled up with a 0
  int stride;                   ///< from one row of places to the next, at least places + score_padding
  int lines, places;            ///< of the picture
  bool along_rows;              ///< whether lines are rows

  /// Which of a picture's pixels, as in `squares`.
  std::int32_t index(int line, int place) const { return line * stride + place; }
  /// The first pair of a pixel's sequence; the others follow `stride` apart.
  const std::int32_t* sequence(int line, int place) const {
    return data + static_cast<std::ptrdiff_t>(line) * pairs * stride + place;
  }
  const std::int32_t* sequence(std::int32_t index) const { return sequence(index / stride, index % stride); }
};

/// A sequence that looks for its like, where it is stored.
struct OwnSequence {
  const std::int32_t* first;  ///< pair
  std::ptrdiff_t step;        ///< from a pair to the next
  std::int32_t square;        ///< scalar product with itself

  std::int32_t pair(int j) const { return first[j * step]; }
};

/// Scalar product of two pairs of samples.
inline std::int32_t multiply_pairs(std::int32_t a, std::int32_t b) {
  const auto low = [](std::int32_t pair) { return static_cast<std::int32_t>(static_cast<std::int16_t>(pair)); };
  return low(a) * low(b) + (a >> 16) * (b >> 16);
}

/// Scalar product of two pixels' sequences.
inline std::int32_t multiply(const SequenceArrays& arrays, std::int32_t a, std::int32_t b) {
  const std::int32_t *p = arrays.sequence(a), *q = arrays.sequence(b);
  std::int32_t sum = 0;
  for (int j = 0; j < arrays.pairs; ++j, p += arrays.stride, q += arrays.stride) sum += multiply_pairs(*p, *q);
  return sum;
}

}  // namespace pagesweep
