// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <vector>

#include "pagesweep/timing/coarse_search_internal.h"
#include "pagesweep/timing/pixel_time_internal.h"
#include "pagesweep/timing/plain_bells_internal.h"
#include "pagesweep/timing/raw_row_internal.h"
#include "pagesweep/timing/stripe_width.h"

namespace pagesweep {

/// Time values of the plain cases among the pixels of a camera, straight from the frames as they are. One a thread.
class PlainRows {
 public:
  /// Whether this camera can be read that way.
  static bool are_possible(const Frames& frames);

  /// The arguments must outlive this. \pre are_possible(frames)
  PlainRows(const Frames& frames, const BellTables& tables, const StripeWidths& widths, const PixelJudge& judge);

  /// The pixels left, left + 1, ... of a row.
  /// \param put    takes the column and the time of a plain case, or of a pixel without a stripe
  /// \param alone  [out] columns of all others
  void estimate(int y, int left, int columns, const std::function<void(int, const PixelTime&)>& put,
                std::vector<int>& alone);

 private:
  struct Candidate {
    int x;       ///< column
    int centre;  ///< [frames] of the bell, nearly
    double log_width;
    bool may_be_noise;  ///< a bell at the limit of judge_bell(): if it cannot be fitted it is none
  };

  void estimate_tile(int tile_left, const std::function<void(int, const PixelTime&)>& put, std::vector<int>& alone);
  /// Looks closely at who is too far from the others in time to share a tile. \return first frame of the tile
  int gather_in_time(const std::function<void(int, const PixelTime&)>& put);
  bool is_clipped(const Candidate& candidate, const float* gray) const;
  void fit(bool whole, int tile_left, int first, const std::function<void(int, const PixelTime&)>& put);
  /// The likelihood fit of one pixel by itself.
  PixelTime look_closely(const Candidate& candidate);
  PixelWindow window_around(const Candidate& candidate, int frame);
  bool is_whole(int centre) const;
  /// The verdict on a bell of which samples are missing.
  PixelStatus judge_partial(const Candidate& candidate, const PixelTime& time, const float* gray);

  const Frames& frames_;
  const StripeWidths& widths_;
  const PixelJudge& judge_;
  CoarseSearch search_;
  PlainBells bells_;
  int tile_frames_;  ///< a multiple of the pixels of a tile
  int pad_;          ///< [frames] before the first and after the last that a tile may reach
  RawRow row_;
  int row_y_ = -1;
  std::vector<float> present_;      ///< [pad + frames + pad] 1 where there is a frame
  std::vector<int> absent_before_;  ///< how many of present_ before an entry are 0
  std::vector<float> tile_;         ///< samples of 16 pixels
  std::vector<float> log_widths_;
  std::vector<float> window_;
  std::vector<Candidate> candidates_, fitted_;
};

}  // namespace pagesweep
