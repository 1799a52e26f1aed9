// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/recorded_times_internal.h"

#include <algorithm>
#include <cstring>
#include <limits>

#include "pagesweep/base/parallel.h"
#include "pagesweep/timing/width_meter_internal.h"

namespace pagesweep {
namespace {

/// Calls body(begin, end) for ranges of tiles, on all threads.
template <class Body>
void for_tiles(std::size_t count, const Body& body) {
  constexpr int grain = 8;
  parallel_ranges(static_cast<int>(count), grain, body);
}

}  // namespace

bool RecordedTimes::can_estimate(const Sequence& sequence, const TimingOptions& options) {
  return options.estimator == TimeEstimator::refined && !options.use_saturated && StripeRecorder::can_record(sequence);
}

RecordedTimes::RecordedTimes(const Sequence& sequence, const StripeProfile& profile, const SensorNoise& noise,
                             const TimingOptions& options)
    : profile_(profile),
      noise_(noise),
      // How many frames there will be is not known before the end.
      judge_{profile, noise, std::numeric_limits<int>::max(), options.min_amplitude, options.max_sigma, true},
      tables_(profile, reach_around(profile)),
      recorder_(sequence, profile.full_width_half_maximum(),
                PlainBells(tables_, noise, profile.full_width_half_maximum()).reach(), noise.read_variance),
      measures_widths_(!options.uniform_width),
      width_tiles_(width_tiles(sequence.width), width_tiles(sequence.height), not_a_number),
      map_(sequence.width, sequence.height) {
  for (int row = 0; row < width_tiles_.height(); ++row)
    for (int column = 0; column < width_tiles_.width(); ++column) tiles_.push_back({column, row});
}

RecordedTimes::RecordedTimes(const Sequence& sequence, const StripeProfile& profile, const SensorNoise& noise,
                             const TimingOptions& options, StripeWidths widths)
    : RecordedTimes(sequence, profile, noise, options) {
  measures_widths_ = false;
  widths_ = std::move(widths);
}

bool RecordedTimes::is_settled(const Tile& tile) const {
  const StripeRecorder::Tile& seen = recorder_.tiles()(tile.column, tile.row);
  if (seen.waiting > 0) return false;
  const Sequence& sequence = recorder_.windows().sequence();
  const WidthTile place = width_tile(sequence.width, sequence.height, tile.column, tile.row);
  return seen.pixels == place.width * place.height || seen.clear == tile.clear_before;
}

bool RecordedTimes::are_around_settled(const Tile& tile) const {
  for (int row = std::max(0, tile.row - 1); row <= std::min(tile.row + 1, width_tiles_.height() - 1); ++row)
    for (int column = std::max(0, tile.column - 1); column <= std::min(tile.column + 1, width_tiles_.width() - 1);
         ++column)
      if (!is_settled(tiles_[static_cast<std::size_t>(row * width_tiles_.width() + column)])) return false;
  return true;
}

std::array<float, 9> RecordedTimes::widths_around(const Tile& tile) const {
  std::array<float, 9> widths{};
  for (int k = 0; k < 9; ++k)
    widths[static_cast<std::size_t>(k)] = widths_.tile(tile.column + k % 3 - 1, tile.row + k / 3 - 1);
  return widths;
}

void RecordedTimes::measure_widths(const std::vector<Tile*>& tiles) {
  if (!measures_widths_ || tiles.empty()) return;
  tables_.cover({1 / widest_stripe, widest_stripe});
  const StripeWindows& windows = recorder_.windows();
  for_tiles(tiles.size(), [&](int begin, int end) {
    WidthMeter meter(windows, tables_, profile_, noise_);
    for (int i = begin; i < end; ++i) {
      Tile& tile = *tiles[static_cast<std::size_t>(i)];
      const WidthTile place = width_tile(windows.sequence().width, windows.sequence().height, tile.column, tile.row);
      width_tiles_(tile.column, tile.row) = meter.measure(place);
      tile.measured_from = recorded(tile);
      tile.measured_clear = clear(tile);
    }
  });
  widths_ = widths_of_tiles(width_tiles_);
}

void RecordedTimes::estimate(const std::vector<Tile*>& tiles) {
  if (tiles.empty()) return;
  const StripeWindows& windows = recorder_.windows();
  tables_.cover(widths_.range());
  for_tiles(tiles.size(), [&](int begin, int end) {
    TileTimes times(windows, tables_, widths_, judge_, map_);
    for (int i = begin; i < end; ++i) {
      Tile& tile = *tiles[static_cast<std::size_t>(i)];
      const WidthTile place = width_tile(windows.sequence().width, windows.sequence().height, tile.column, tile.row);
      const bool is_all_new = tile.estimated_from < 0 || tile.widths != widths_around(tile);
      for (int y = place.top; y < place.top + place.height; ++y) estimate_row(times, place, y, is_all_new);
      tile.estimated_from = recorded(tile);
      tile.estimated_clear = clear(tile);
      tile.widths = widths_around(tile);
    }
  });
}

void RecordedTimes::estimate_row(TileTimes& times, const WidthTile& place, int y, bool is_all_new) {
  constexpr int group_px = StripeRecorder::group_px;
  // Pixels of a group are fitted together: what one group shows is not touched by what others do.
  for (int left = place.left; left < place.left + place.width; left += group_px) {
    std::uint8_t& is_new = recorder_.news()(left / group_px, y);
    if (is_all_new || is_new != 0) times.estimate(y, left, std::min(group_px, place.left + place.width - left));
    is_new = 0;
  }
}

double RecordedTimes::known_until() const {
  double until = recorder_.recorded_until();
  for (const Tile& tile : tiles_)
    if (tile.estimated_clear != clear(tile)) until = std::min(until, recorder_.earliest(tile.column, tile.row));
  return until;
}

void RecordedTimes::look(const Frames& frames, int end) {
  for (Tile& tile : tiles_) tile.clear_before = clear(tile);
  recorder_.look(frames, end, false);
  std::vector<Tile*> to_measure, to_estimate;
  for (Tile& tile : tiles_)
    if (is_settled(tile) && tile.measured_clear != clear(tile)) to_measure.push_back(&tile);
  measure_widths(to_measure);
  for (Tile& tile : tiles_)
    if (tile.estimated_clear != clear(tile) && are_around_settled(tile)) to_estimate.push_back(&tile);
  estimate(to_estimate);
}

void RecordedTimes::finish(const Frames& frames) {
  judge_.frame_count = frames.count();
  recorder_.look(frames, frames.count(), true);
  std::vector<Tile*> to_measure, to_estimate;
  for (Tile& tile : tiles_)
    if (tile.measured_from != recorded(tile)) to_measure.push_back(&tile);
  measure_widths(to_measure);
  for (Tile& tile : tiles_)
    if (tile.estimated_from != recorded(tile) || tile.widths != widths_around(tile)) to_estimate.push_back(&tile);
  estimate(to_estimate);
}

}  // namespace pagesweep
