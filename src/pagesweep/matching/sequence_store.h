// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "pagesweep/base/image.h"
#include "pagesweep/data/frames.h"
#include "pagesweep/data/status.h"
#include "pagesweep/matching/match_epipolar.h"
#include "pagesweep/matching/sequence_kernels_internal.h"

namespace pagesweep {

/// The gray value sequences of one camera, pixel by pixel, as 16 bit integers ready for scalar products.
///
/// Normalisation none: gray values, scaled such that full scale in all frames has the length `sequence_scale`. Affine:
/// mean removed, then scaled to that length; the squared difference of two such sequences is 2 sequence_scale^2
/// (1 - correlation). A clipped sample stands as the saturation value. Pixels without a sequence have zeros.
class SequenceStore {
 public:
  /// \param instants  the frames to use
  SequenceStore(const Frames& frames, const std::vector<int>& instants, const MatchOptions& options);

  int width() const { return status_.width(); }
  int height() const { return status_.height(); }
  int samples() const { return samples_; }  ///< a sequence, without filling
  SequenceArrays arrays() const {
    return {data_[0].samples, squares_.empty() ? nullptr : squares_.data(), length(), width(), height()};
  }
  const std::int16_t* sequence(int x, int y) const { return arrays().sequence(y * width() + x); }
  /// Scalar product of a sequence with itself.
  std::int32_t square(int x, int y) const { return squares_.empty() ? full_square : squares_[index(x, y)]; }
  /// Sum of squared deviations from the sequence's mean, in the store's own units.
  float energy(int x, int y) const { return energy_(x, y); }
  /// Variance of one stored sample that comes from rounding the gray values, in the store's own units.
  float rounding_variance(int x, int y) const { return rounding_variance_(x, y); }
  float rounding_variance(std::int32_t pixel) const { return rounding_variance_.data()[pixel]; }
  /// ok, too_dark, or saturated where every sample is clipped.
  PixelStatus status(int x, int y) const { return status_(x, y); }
  PixelStatus status(std::int32_t pixel) const { return status_.data()[pixel]; }

 private:
  static constexpr std::int32_t full_square = sequence_scale * sequence_scale;
  static constexpr std::int32_t nothing = 4 * full_square;  ///< in place of a square: unlike everything

  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width()) + static_cast<std::size_t>(x);
  }
  std::int16_t* sequence_at(std::size_t pixel) { return data_[pixel * parts_].samples; }
  int length() const { return static_cast<int>(parts_) * sequence_padding; }
  void store_rows(const Frames& frames, const std::vector<int>& instants, const MatchOptions& options, int begin,
                  int end);
  void store(int left, int y, const GrayRows& gray, const MatchOptions& options);

  /// A cache line. Allocated without being cleared: the threads that fill it touch it first.
  struct alignas(2 * sequence_padding) SequencePart {
    std::int16_t samples[sequence_padding];
  };

  int samples_;
  std::size_t parts_;                     ///< of a sequence
  std::unique_ptr<SequencePart[]> data_;  ///< sequence by sequence, and one of zeros
  std::vector<std::int32_t> squares_;     ///< empty where all are alike
  Image<float> energy_, rounding_variance_;
  Image<PixelStatus> status_;
};

}  // namespace pagesweep
