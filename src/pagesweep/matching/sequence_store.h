// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "pagesweep/base/image.h"
#include "pagesweep/data/frames.h"
#include "pagesweep/data/status.h"
#include "pagesweep/matching/match_epipolar.h"

namespace pagesweep {

/// The gray value sequences of one camera, pixel by pixel, as integers ready for the sum of squared differences.
///
/// Normalisation none: gray values, scaled so that full scale is `full_scale`. Affine: mean removed, then scaled to the
/// length `full_scale`; the squared difference of two such sequences is 2 full_scale^2 (1 - correlation). A clipped
/// sample stands as the saturation value.
class SequenceStore {
 public:
  static constexpr int full_scale = 4095;  ///< 64 squared differences fit into 32 bits
  static constexpr int lanes = 8;          ///< sequences are filled up with zeros to a multiple of this

  /// \param instants  the frames to use
  SequenceStore(const Frames& frames, const std::vector<int>& instants, const MatchOptions& options);

  int width() const { return status_.width(); }
  int height() const { return status_.height(); }
  int samples() const { return samples_; }  ///< a sequence, without filling
  int length() const { return length_; }    ///< a sequence, with filling
  const std::int16_t* sequence(int x, int y) const {
    return data_.data() +
           (static_cast<std::size_t>(y) * static_cast<std::size_t>(width()) + static_cast<std::size_t>(x)) *
               static_cast<std::size_t>(length_);
  }
  /// Sum of squared deviations from the sequence's mean, in the store's own units.
  float energy(int x, int y) const { return energy_(x, y); }
  /// Variance of one stored sample that comes from rounding the gray values, in the store's own units.
  float rounding_variance(int x, int y) const { return rounding_variance_(x, y); }
  /// ok, too_dark, or saturated where every sample is clipped.
  PixelStatus status(int x, int y) const { return status_(x, y); }

 private:
  int samples_;
  int length_;
  std::vector<std::int16_t> data_;
  Image<float> energy_, rounding_variance_;
  Image<PixelStatus> status_;
};

}  // namespace pagesweep
