// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <vector>

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
  /// \param instants    the frames to use
  /// \param along_rows  whether epipolar curves run along this picture's rows rather than its columns
  SequenceStore(const Frames& frames, const std::vector<int>& instants, bool along_rows, const MatchOptions& options);

  int samples() const { return samples_; }
  const SequenceArrays& arrays() const { return arrays_; }
  /// Of a pixel, as all that follow take it.
  std::int32_t index(int x, int y) const { return arrays_.along_rows ? arrays_.index(y, x) : arrays_.index(x, y); }
  OwnSequence sequence(std::int32_t index) const { return {arrays_.sequence(index), arrays_.stride, own_[at(index)]}; }
  /// Sum of squared deviations from the sequence's mean, in the store's own units.
  float energy(std::int32_t index) const { return energy_[at(index)]; }
  /// Variance of one stored sample that comes from rounding the gray values, in the store's own units.
  float rounding_variance(std::int32_t index) const { return rounding_variance_[at(index)]; }
  /// ok, too_dark, or saturated where every sample is clipped.
  PixelStatus status(std::int32_t index) const { return status_[at(index)]; }
  /// Whether this pixel and the three next places of its line have sequences.
  bool are_known(std::int32_t index) const {
    static_assert(PixelStatus::ok == PixelStatus{} && sizeof(PixelStatus) == 1);
    std::uint32_t statuses;
    std::memcpy(&statuses, &status_[at(index)], sizeof(statuses));
    return statuses == 0;
  }

 private:
  static constexpr std::int32_t full_square = sequence_scale * sequence_scale;
  static constexpr std::int32_t nothing = 4 * full_square;  ///< in place of a square: unlike everything

  /// A cache line.
  struct alignas(4 * score_padding) PairBlock {
    std::int32_t pairs[score_padding];
  };

  static std::size_t at(std::int32_t index) { return static_cast<std::size_t>(index); }
  void store_rows(const Frames& frames, const std::vector<int>& instants, const MatchOptions& options, int begin,
                  int end);
  template <class Sample>
  void store(int left, int y, const SampleRows<Sample>& gray, const MatchOptions& options);
  void store_zeros(std::int32_t index);
  std::int32_t* pairs_at(int line, int place) {
    return pairs_[0].pairs + (arrays_.sequence(line, place) - arrays_.data);
  }

  int samples_;
  SequenceArrays arrays_;
  /// Allocated without being cleared: the threads that fill it touch it first.
  std::unique_ptr<PairBlock[]> pairs_;
  std::unique_ptr<std::int32_t[]> own_, next_;
  std::unique_ptr<float[]> energy_, rounding_variance_;
  std::unique_ptr<PixelStatus[]> status_;
  std::vector<std::int32_t> squares_;  ///< empty where all are alike
};

}  // namespace pagesweep
