// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <vector>

#include "pagesweep/data/time_map.h"
#include "pagesweep/timing/bell_tables_internal.h"
#include "pagesweep/timing/estimate_times.h"
#include "pagesweep/timing/pixel_time_internal.h"
#include "pagesweep/timing/stripe_recorder_internal.h"
#include "pagesweep/timing/tile_times_internal.h"

namespace pagesweep {

/// Refined time values of one camera while its frames arrive.
///
/// Pixels are estimated tile by tile as the stripe leaves them, from what is known by then. What turns out otherwise in
/// the end, a window because the pixel has met brighter light or a stripe width because the tile beside has only now
/// been seen, is estimated again, so that the steps in which frames arrived leave no trace in the result.
class RecordedTimes {
 public:
  static bool can_estimate(const Sequence& sequence, const TimingOptions& options);

  /// \param profile  must outlive this
  /// \pre can_estimate(sequence, options)
  RecordedTimes(const Sequence& sequence, const StripeProfile& profile, const SensorNoise& noise,
                const TimingOptions& options);
  /// The same with widths that are known.
  RecordedTimes(const Sequence& sequence, const StripeProfile& profile, const SensorNoise& noise,
                const TimingOptions& options, StripeWidths widths);

  /// Looks at the frames before `end`, see StripeRecorder::look(), and estimates what the stripe has left.
  void look(const Frames& frames, int end);
  int first_needed() const { return recorder_.first_needed(); }
  /// What is estimated so far.
  const TimeMap& so_far() const { return map_; }
  /// [frames] Pixels that the stripe passed before are estimated, but for those that hardly show it.
  double known_until() const;
  /// Looks at all that is left when no more frames will come. Once, at the end.
  void finish(const Frames& frames);

  /// What came out, to be taken away. After finish().
  TimeMap& map() { return map_; }
  StripeWidths& widths() { return widths_; }
  Image<std::uint8_t>& clipped_frames() { return recorder_.clipped_frames(); }

 private:
  /// What is known of a tile.
  struct Tile {
    int column = 0, row = 0;
    int clear_before = 0;           ///< clear windows, one look ago
    int measured_from = 0;          ///< windows that its width was measured from
    int measured_clear = 0;         ///< clear ones of them
    int estimated_from = -1;        ///< windows that its times were estimated from
    int estimated_clear = 0;        ///< clear ones of them
    std::array<float, 9> widths{};  ///< of it and around it, which they were estimated with
  };
  int recorded(const Tile& tile) const { return recorder_.tiles()(tile.column, tile.row).windows; }
  int clear(const Tile& tile) const { return recorder_.tiles()(tile.column, tile.row).clear; }
  /// Whether the stripe is not in the tile: it has passed all its pixels, or some and then nothing more happened.
  bool is_settled(const Tile& tile) const;
  bool are_around_settled(const Tile& tile) const;
  std::array<float, 9> widths_around(const Tile& tile) const;
  void measure_widths(const std::vector<Tile*>& tiles);
  void estimate(const std::vector<Tile*>& tiles);
  /// A row of a tile; unless it is all new, only the groups that have got a window.
  void estimate_row(TileTimes& times, const WidthTile& place, int y, bool is_all_new);

  const StripeProfile& profile_;
  FrameNoise noise_;
  PixelJudge judge_;
  BellTables tables_;
  StripeRecorder recorder_;
  bool measures_widths_;
  Image<float> width_tiles_;
  StripeWidths widths_;
  std::vector<Tile> tiles_;
  TimeMap map_;
};

}  // namespace pagesweep
