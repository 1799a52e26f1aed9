// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "pagesweep/matching/follow_curves.h"

namespace pagesweep {

/// Stored sequences are filled up with zeros to a multiple of this: a cache line, and the longest vector.
inline constexpr int sequence_padding = 32;
/// Length of every stored sequence in its scalar product with itself, at most: products then fit into 32 bits.
inline constexpr int sequence_scale = (1 << 14) - 1;
/// Arrays that are filled whole vectors at a time have room for a multiple of this.
inline constexpr int score_padding = 16;

/// Gray values of some pixels: a row for each frame.
struct GrayRows {
  std::span<const float* const> frames;  ///< a multiple of score_padding values can be read of each
  int pixels;
  float range;  ///< [gray values] what is above stands for as much
};

/// What is known about each of these pixels' sequences. There is room for a multiple of score_padding pixels.
struct SequenceStatistics {
  float* energy;   ///< [gray values^2] sum of squared deviations from the mean
  float* lowest;   ///< [gray values]
  float* highest;  ///< [gray values]
  float* scale;    ///< [1 / gray value] of the stored sequence
};

/// Stores the sequences pixel by pixel.
/// \param affine  the mean is removed and the length becomes sequence_scale; else `range` in all frames has that length
/// \param out     `length` entries a pixel: those beyond the frames become 0
void pack_sequences(const GrayRows& gray, bool affine, int length, std::int16_t* out,
                    const SequenceStatistics& statistics);

/// All sequences of a picture, pixel by pixel, and one of zeros behind them.
struct SequenceArrays {
  const std::int16_t* data;
  const std::int32_t* squares;  ///< scalar product of each sequence with itself; null: sequence_scale^2 for all
  int length;                   ///< of a sequence, with filling
  int width, height;            ///< [px]

  std::int32_t nowhere() const { return width * height; }
  const std::int16_t* sequence(std::int32_t pixel) const { return data + static_cast<std::ptrdiff_t>(pixel) * length; }
};

/// An epipolar curve before the lens bends it, in ideal coordinates: places at (x, y) + k (dx, dy).
struct CurveLine {
  float x, y, dx, dy;
  int count;
};

/// Compares a sequence with those of the pixels nearest to a curve's places.
/// \param own       the sequence, and its scalar product with itself
/// \param pixels    becomes the pixel of each place, nowhere() where the picture does not show it
/// \param scores    becomes the sum of squared differences (eq. 1); that from zeros where there is nothing, and behind
///                  the last place: a multiple of score_padding
/// \return the least one
std::int32_t score_curve(const SequenceArrays& to, const LensNumbers& lens, const CurveLine& line,
                         const std::int16_t* own, std::int32_t own_square, std::int32_t* pixels, std::int32_t* scores);

/// A place on a curve that may be the match.
struct CurveMinimum {
  float place;             ///< among those of the curve; once improved, a fraction
  float distance_squared;  ///< there, of the nearest pixel; once improved, interpolated between the two nearest
};

/// What score_curve() found. The entry before the first score is higher than any, and those behind the last are filled
/// up as it does.
struct ScoredCurve {
  const SequenceArrays* to;
  const std::int32_t* pixels;
  const std::int32_t* scores;
  int count;
  std::int32_t own_square;
  bool affine;  ///< see Normalisation
};

/// The places whose scores are at most `limit`, lower than the one before and not higher than the one behind.
/// \param minima  room for half of count, rounded up
/// \return how many there are
int find_minima(const ScoredCurve& curve, std::int32_t limit, CurveMinimum* minima);

/// Interpolates linearly towards the better one of each minimum's neighbours.
void improve_minima(const ScoredCurve& curve, std::span<CurveMinimum> minima);

/// A sequence between two pixels.
struct Crossing {
  const std::int16_t* low;
  const std::int16_t* high;
  std::int16_t share;  ///< [2^-15] of `high`
};

/// Scalar products of a sequence g and those at consecutive crossings S_i.
struct CrossingProducts {
  static constexpr int crossings = 4;

  std::int32_t gg;                        ///< g . g
  std::int32_t gs[crossings];             ///< g . S_i
  std::int32_t ss[crossings][crossings];  ///< S_i . S_j, where i <= j
};
CrossingProducts multiply(const Crossing* crossings, const std::int16_t* own, int length);

/// A sequence between four crossings, and how it changes along the curve.
struct Mixture {
  const Crossing* crossings;
  float value[4], change[4];
  float change_of_own;  ///< so much of the sequence that it is compared with is added to the change
};

/// Sums over the frames of residuals r and changes d.
struct ResidualSums {
  float rr, dd, rrdd;
};
ResidualSums sum_residuals(const Mixture& mixture, const std::int16_t* own, int length);

}  // namespace pagesweep
