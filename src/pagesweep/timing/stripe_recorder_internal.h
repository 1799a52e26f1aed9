// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "pagesweep/base/image.h"
#include "pagesweep/timing/coarse_search_internal.h"
#include "pagesweep/timing/quiet_strips_internal.h"
#include "pagesweep/timing/row_kernels_internal.h"
#include "pagesweep/timing/stripe_windows_internal.h"
#include "pagesweep/timing/width_tiles_internal.h"

namespace pagesweep {

/// Cuts the windows around the stripe out of a camera's frames while they arrive. Which steps it is done in makes no
/// difference to the windows.
class StripeRecorder {
 public:
  /// Windows change tile by tile.
  static constexpr int tile_px = width_tile_px;

  /// Whether the frames can be recorded that way: they must be of one exposure.
  static bool can_record(const Sequence& sequence);

  /// \param fwhm           of the stripe [frames]
  /// \param half           [frames] to both sides of the stripe's middle that a window has
  /// \param read_variance  [gray values^2]
  /// \pre can_record(sequence)
  StripeRecorder(const Sequence& sequence, double fwhm, int half, double read_variance);

  /// Looks at the frames before `end` as far as that is news. All from first_needed() on must be there.
  /// \param ended  no more will come
  void look(const Frames& frames, int end, bool ended);
  /// Frames before this one are needed no more. The last of them that there is may stand for a dropped one.
  int first_needed() const;

  const StripeWindows& windows() const { return windows_; }
  /// What was recorded of a tile so far.
  struct Tile {
    int windows = 0;  ///< those included that another has replaced
    int clear = 0;    ///< of them, those whose bell is not noise
    int pixels = 0;   ///< that have a window
    int waiting = 0;  ///< pixels whose bell is clear and not over yet
  };
  const Image<Tile>& tiles() const { return tiles_; }
  /// Of each `group_px` pixels side by side, entry (x / group_px, y), whether one got a window since the entry was
  /// last cleared.
  static constexpr int group_px = tile_pixels;
  Image<std::uint8_t>& news() { return news_; }
  /// [frames] Clear bells whose middle lies before have windows.
  double recorded_until() const { return (ready_done_ + 1) * search_.block() - 0.5; }
  /// [frames] Middle of the earliest clear bell of a tile; infinity if there is none.
  double earliest(int column, int row) const;
  /// In how many frames each pixel is clipped (255: that many or more).
  Image<std::uint8_t>& clipped_frames() { return clipped_; }

 private:
  /// What a step does to the pixels.
  struct Step {
    CoarseSearch::Step search;
    int last_ready;  ///< place; bells there and before are over
    int begin, end;  ///< [frames] that take part
    int news;        ///< [frames] first one that was not there before
    bool is_first;   ///< nothing was looked at before
  };
  struct Scratch;
  /// Last place whose window ends before frame `end`.
  int last_ready(int end) const;
  void look_at_rows(const Frames& frames, const Step& step, int first_row, int end_row);
  void count_clipped(const Frames& frames, const Step& step, int y);
  void search(const Step& step, const RawRow& rows, int y, Scratch& scratch);
  void record(const Step& step, const RawRow& rows, int y, int left, Scratch& scratch);
  template <class T>
  void cut(const Step& step, const RowsOf<T>& rows, int y, int left, Scratch& scratch);

  CoarseSearch search_;
  QuietStrips quiet_;
  StripeWindows windows_;
  Image<std::int32_t> recorded_place_;  ///< of each pixel's window
  Image<Tile> tiles_;
  Image<std::uint8_t> news_;
  Image<std::uint8_t> clipped_;
  int places_done_ = 0;
  int ready_done_ = -1;  ///< place
  int frames_done_ = 0;
  std::vector<std::uint8_t> present_;
  std::vector<float> late_;
};

}  // namespace pagesweep
