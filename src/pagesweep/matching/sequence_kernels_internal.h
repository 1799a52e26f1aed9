// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "pagesweep/matching/sequence_arrays_internal.h"

namespace pagesweep {

/// Gray values of some pixels: a row for each frame.
template <class Sample>
struct SampleRows {
  std::span<const Sample* const> frames;  ///< a multiple of score_padding values can be read of each
  int pixels;
  float range;            ///< [gray values] what is above stands for as much
  float black_level = 0;  ///< [gray values] is taken off
};
using GrayRows = SampleRows<float>;
using ByteRows = SampleRows<std::uint8_t>;

/// What is known about each of these pixels' sequences. There is room for a multiple of score_padding pixels.
struct SequenceStatistics {
  float* energy;   ///< [gray values^2] sum of squared deviations from the mean
  float* lowest;   ///< [gray values]
  float* highest;  ///< [gray values]
  float* scale;    ///< [1 / gray value] of the stored sequence
};

/// Where sequences are stored: pair j of pixel p at first[j pair_step + p pixel_step].
struct PairPlaces {
  std::int32_t* first;
  std::ptrdiff_t pair_step, pixel_step;  ///< if pixels follow each other, there is room for a multiple of score_padding
};

/// Stores some pixels' sequences, two frames in 32 bits; an odd one is followed by a 0.
/// \param affine  the mean is removed and the length becomes sequence_scale; else `range` in all frames has that length
void pack_sequences(const GrayRows& gray, bool affine, const PairPlaces& out, const SequenceStatistics& statistics);
void pack_sequences(const ByteRows& gray, bool affine, const PairPlaces& out, const SequenceStatistics& statistics);

/// Scalar products of a line's sequences with themselves and with those of their next places.
/// \param own, next  [place] there is room for a multiple of score_padding
void multiply_neighbours(const SequenceArrays& arrays, int line, std::int32_t* own, std::int32_t* next);

/// Sequences between two pixels each.
struct Crossings {
  static constexpr int count = 4;

  std::array<const std::int32_t*, count> low, high;  ///< their first pairs
  bool are_neighbours;        ///< in memory, those of `low` and those of `high`: then the first ones serve for all
  const std::int32_t* share;  ///< of each: in both halves, the share [2^-15] of `high`
};

/// Scalar products of a sequence g and those at consecutive crossings S_i.
struct CrossingProducts {
  std::int32_t gs[Crossings::count];                    ///< g . S_i
  std::int32_t ss[Crossings::count][Crossings::count];  ///< S_i . S_j, where i <= j
};
CrossingProducts multiply(const SequenceArrays& to, const Crossings& crossings, const OwnSequence& own);

/// Sequences between four crossings, and how they change along their curves, for some pixels.
struct MixtureBatch {
  static constexpr int most = 16;
  using Each = std::array<float, most>;

  std::vector<std::int32_t> own;                                     ///< [pair][pixel]
  std::vector<std::int32_t> crossings;                               ///< [pair][pixel][crossing]
  alignas(64) std::array<Each, Crossings::count> value{}, change{};  ///< weights of the crossings
  alignas(64) Each change_of_own{};  ///< so much of the own sequence is added to the change
  alignas(64) Each rrdd{};           ///< sum over the frames of the squared product of residual r and change d
};
/// Enters one pixel's sequence, and those at the crossings.
void enter(const SequenceArrays& to, const Crossings& crossings, const OwnSequence& own, std::size_t pixel,
           MixtureBatch& batch);
void sum_weighted_residuals(int pairs, MixtureBatch& batch);

}  // namespace pagesweep
