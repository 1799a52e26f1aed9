// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "pagesweep/base/image.h"
#include "pagesweep/timing/raw_row_internal.h"

namespace pagesweep {

/// Finds where, roughly, the stripe passes each pixel of a row: StripeSearch for frames of one exposure, in a fraction
/// of its time. Frames are summed in blocks of half the stripe's length; the response is that of two blocks against
/// two before and two after them, and a parabola through three responses tells the place between blocks.
class CoarseSearch {
 public:
  /// \param fwhm         full width of the stripe at half height [frames]
  /// \param read_variance  [gray values^2] of a sample without light
  CoarseSearch(int frame_count, double fwhm, double read_variance);

  /// Looks at the pixels left, left + 1, ... of a row.
  /// \param pad  entries of `row` before frame 0
  void find(const RawRow& row, int pad, int left, int columns);

  /// Nearest to the bell's middle of pixel left + x.
  int frame(int x) const;
  /// How many standard deviations the response lies above what noise alone would give.
  double significance(int x) const { return rise_[static_cast<std::size_t>(x)] * per_sigma_; }

 private:
  template <class T>
  void sum_blocks(const RowsOf<T>& rows, int pad, int left);

  int frame_count_;
  int block_;  ///< [frames]
  double per_sigma_;
  Image<float> sums_;       ///< a row a block
  Image<float> responses_;  ///< row k: of blocks k and k + 1
  std::vector<float> rise_;
  std::vector<std::int32_t> best_;
};

}  // namespace pagesweep
