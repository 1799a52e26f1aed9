// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "pagesweep/base/image.h"
#include "pagesweep/timing/raw_row_internal.h"
#include "pagesweep/timing/row_kernels_internal.h"

namespace pagesweep {

/// Finds where, roughly, the stripe passes each pixel, while the frames arrive: StripeSearch for frames of one
/// exposure, in a fraction of its time. Frames are summed in blocks of half the stripe's length; the response at a
/// place, between two blocks, is that of those two against two before and two after them, and a parabola through three
/// responses tells the place between blocks.
class CoarseSearch {
 public:
  /// \param fwhm           full width of the stripe at half height [frames]
  /// \param read_variance  [gray values^2] of a sample without light
  CoarseSearch(int width, int height, double fwhm, double read_variance);

  int block() const { return block_; }  ///< [frames]

  /// What is looked at in one go: the places that frames before `end` allow and those before did not.
  struct Step {
    int first_place = 0, end_place = 0;
    int first_block = 0, end_block = 0;  ///< whose sums take part
    int frame_count = 0;                 ///< of the recording, if `ended`; else frames there are now
    bool ended = false;                  ///< no more frames will come: beyond them, one side stands for both
  };
  /// \param done  places looked at already
  Step next_step(int done, int frame_count, bool ended) const;
  /// First frame that the step after `done` places needs.
  int first_needed(int done) const { return std::max(0, done - 4) * block_; }
  /// How many blocks' frames before those that are new to a step it may need.
  static constexpr int blocks_again = 9;

  /// Looks at the pixels left, left + 1, ... of row y.
  /// \param rows         frames from first_frame on
  /// \param sums         scratch memory
  void look(const Step& step, const RawRow& rows, int first_frame, int y, int left, int columns, Image<float>& sums);

  /// Place of the highest response; -1 before the first.
  int best(int x, int y) const { return best_(x, y); }
  /// How many standard deviations it lies above what noise alone would give.
  float significance(int x, int y) const { return rise_(x, y) * per_sigma_; }
  /// Of the pixels left, left + 1, ... of row y.
  Extremes extremes(int y, int left, int columns) const {
    const auto at = static_cast<std::size_t>(left);
    return extremes_of(&rise_.row(y)[at], &best_.row(y)[at], static_cast<std::size_t>(columns));
  }
  /// Nearest to the bell's middle. \pre best(x, y) >= 0
  int frame(int x, int y, int frame_count) const;

 private:
  template <class T>
  void sum_blocks(const Step& step, const RowsOf<T>& rows, int first_frame, int left, int columns,
                  Image<float>& sums) const;

  int block_;
  float per_sigma_;
  Image<float> rise_, before_, after_;
  Image<std::int32_t> best_;
};

}  // namespace pagesweep
