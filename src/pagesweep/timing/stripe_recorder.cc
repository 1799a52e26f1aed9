// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/stripe_recorder_internal.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <limits>
#include <span>

#include "pagesweep/base/parallel.h"

namespace pagesweep {
namespace {

constexpr int most_apart = 32;  // [frames] between the bells of pixels that are cut out together
/// Half a sigma less than a bell needs to be told from noise: between two blocks the response is that much lower.
constexpr float least_significance = 3;
/// What noise does not reach in a whole camera.
constexpr float clear_significance = 7;

/// Counts the frames begin, begin + 1, ... before `end` in which each pixel of row y is clipped.
template <class T>
void count_clipped_of(const Frames& frames, int begin, int end, int y, std::span<std::uint8_t> counts) {
  const double saturation = std::max(0.0, std::ceil(frames.sequence().saturation));
  if (saturation > std::numeric_limits<T>::max()) return;
  RowsOf<T> rows;
  for (int i = begin; i < end; ++i)
    if (frames.has(i)) rows.push_back(std::get<Image<T>>(frames.frame(i)).row(y).data());
  count_clipped_rows(rows, static_cast<T>(saturation), counts);
}

/// The rows of frames first ... end - 1, of which `all` are those from `begin` on. Where there is none, the nearest
/// one.
template <class T>
std::span<const T* const> rows_around(const RowsOf<T>& all, int begin, int first, int end, RowsOf<T>& copy) {
  const int count = static_cast<int>(all.size());
  if (first >= begin && end <= begin + count)
    return std::span(all).subspan(static_cast<std::size_t>(first - begin), static_cast<std::size_t>(end - first));
  copy.clear();
  for (int i = first; i < end; ++i) copy.push_back(all[static_cast<std::size_t>(std::clamp(i - begin, 0, count - 1))]);
  return copy;
}

}  // namespace

struct StripeRecorder::Scratch {
  struct Ready {
    int x;
    int centre;  ///< [frames]
  };
  Image<float> sums;
  std::vector<Ready> ready;
  std::vector<std::uint16_t> tile;  ///< of either depth
};

bool StripeRecorder::can_record(const Sequence& sequence) {
  return sequence.width >= tile_pixels &&
         std::ranges::all_of(sequence.exposures, [](double exposure) { return exposure == 1; });
}

StripeRecorder::StripeRecorder(const Sequence& sequence, double fwhm, int half, double read_variance)
    : search_(sequence.width, sequence.height, fwhm, read_variance),
      quiet_(sequence.width, sequence.height, search_.block()),
      windows_(sequence, half),
      recorded_place_(sequence.width, sequence.height, -1),
      tiles_(width_tiles(sequence.width), width_tiles(sequence.height)),
      news_((sequence.width + group_px - 1) / group_px, sequence.height),
      clipped_(sequence.width, sequence.height) {}

int StripeRecorder::last_ready(int end) const {
  // A bell's middle is within half a block of its place, place k at the border (k + 1) block; and the response after
  // the highest one must have been seen.
  const int block = search_.block();
  return std::min((end - 1 - windows_.half() - (block + 1) / 2) / block - 1, end / block - 6);
}

int StripeRecorder::first_needed() const {
  const int block = search_.block();
  const int first_of_window = (ready_done_ + 2) * block - (block + 1) / 2 - 1 - windows_.half();
  return std::max(0, std::min(first_of_window, search_.first_needed(places_done_)));
}

double StripeRecorder::earliest(int column, int row) const {
  const WidthTile place = width_tile(windows_.sequence().width, windows_.sequence().height, column, row);
  double earliest = std::numeric_limits<double>::infinity();
  for (int y = place.top; y < place.top + place.height; ++y)
    for (int x = place.left; x < place.left + place.width; ++x)
      if (windows_.centre(x, y) != StripeWindows::none && windows_.significance(x, y) >= clear_significance)
        earliest = std::min<double>(earliest, windows_.centre(x, y));
  return earliest;
}

void StripeRecorder::look(const Frames& frames, int end, bool ended) {
  Step step;
  step.search = search_.next_step(places_done_, end, ended);
  step.last_ready = ended ? std::numeric_limits<int>::max() : last_ready(end);
  step.begin = first_needed();
  step.end = end;
  step.news = frames_done_;
  step.is_first = frames_done_ == 0;
  present_.resize(static_cast<std::size_t>(end), 0);
  late_.resize(static_cast<std::size_t>(end), 0);
  for (int i = frames_done_; i < end; ++i) {
    present_[static_cast<std::size_t>(i)] = frames.has(i);
    late_[static_cast<std::size_t>(i)] = frames.late(i);
  }
  windows_.set_frames(present_, late_);
  if (ended) windows_.end_at(end);
  // What stands for a frame that was dropped may lie before.
  while (step.begin > 0 && !frames.has(step.begin)) --step.begin;
  bool any = false;
  for (int i = step.begin; i < end; ++i) any = any || frames.has(i);
  if (!any) return;
  quiet_.begin_step(step.news, end, !step.is_first);
  parallel_ranges(windows_.sequence().height, tile_px,
                  [&](int begin_row, int end_row) { look_at_rows(frames, step, begin_row, end_row); });
  places_done_ = step.search.end_place;
  ready_done_ = ended ? step.search.end_place : step.last_ready;
  frames_done_ = end;
}

void StripeRecorder::look_at_rows(const Frames& frames, const Step& step, int first_row, int end_row) {
  for (Tile& tile : tiles_.row(first_row / tile_px)) tile.waiting = 0;
  Scratch scratch;
  // The kernel fills whole vectors.
  scratch.tile.resize(static_cast<std::size_t>((tile_pixels + 1) * (windows_.length() + most_apart + tile_pixels)));
  for (int y = first_row; y < end_row; ++y) {
    const RawRow rows = raw_row(frames, y, step.begin, step.end);
    if (!step.is_first) quiet_.note(y, rows, step.begin);
    count_clipped(frames, step, y);
    search(step, rows, y, scratch);
  }
}

void StripeRecorder::count_clipped(const Frames& frames, const Step& step, int y) {
  if (!step.is_first && quiet_.highest(y) < frames.sequence().saturation) return;
  if (frames.sequence().is_8_bit())
    count_clipped_of<std::uint8_t>(frames, step.news, step.end, y, clipped_.row(y));
  else
    count_clipped_of<std::uint16_t>(frames, step.news, step.end, y, clipped_.row(y));
}

void StripeRecorder::search(const Step& step, const RawRow& rows, int y, Scratch& scratch) {
  const int width = windows_.sequence().width;
  const auto left_of = [&](int strip) { return std::min(strip * QuietStrips::strip_px, width); };
  for (int strip = 0; strip < quiet_.count();) {
    if (quiet_.is_quiet(strip, y, step.search)) {
      const bool are_all_recorded = quiet_.latest(strip, y) <= ready_done_;
      for (int x = left_of(strip); x < left_of(strip + 1) && !are_all_recorded; x += tile_pixels)
        record(step, rows, y, x, scratch);
      ++strip;
      continue;
    }
    // Long pieces of rows are read faster than short ones.
    const int first = strip++;
    while (strip < quiet_.count() && !quiet_.is_quiet(strip, y, step.search)) ++strip;
    search_.look(step.search, rows, step.begin, y, left_of(first), left_of(strip) - left_of(first), scratch.sums);
    for (int x = left_of(first); x < left_of(strip); x += tile_pixels) record(step, rows, y, x, scratch);
    for (int k = first; k < strip && !step.search.ended; ++k) quiet_.keep(k, y, search_);
  }
}

void StripeRecorder::record(const Step& step, const RawRow& rows, int y, int left, Scratch& scratch) {
  scratch.ready.clear();
  Tile& tile = tiles_(left / tile_px, y / tile_px);
  const int end = std::min(left + tile_pixels, windows_.sequence().width);
  const auto is_new = [&](int x) {
    return (search_.best(x, y) != recorded_place_(x, y)) & (search_.significance(x, y) >= least_significance);
  };
  bool any = false;
  for (int x = left; x < end; ++x) any |= is_new(x);
  if (!any) return;
  for (int x = left; x < end; ++x) {
    if (!is_new(x)) continue;
    const int best = search_.best(x, y);
    const float significance = search_.significance(x, y);
    const bool is_clear = significance >= clear_significance;
    if (best > step.last_ready) {
      tile.waiting += is_clear;
      continue;
    }
    scratch.ready.push_back({x, search_.frame(x, y, windows_.sequence().count)});
    tile.clear += is_clear;
    tile.pixels += windows_.centre(x, y) == StripeWindows::none;
    recorded_place_(x, y) = best;
    windows_.set(x, y, scratch.ready.back().centre, significance);
  }
  if (scratch.ready.empty()) return;
  tile.windows += static_cast<int>(scratch.ready.size());
  news_(left / group_px, y) = 1;
  std::visit([&](const auto& present) { cut(step, present, y, left, scratch); }, rows);
}

template <class T>
void StripeRecorder::cut(const Step& step, const RowsOf<T>& rows, int y, int left, Scratch& scratch) {
  const int tile_left = std::min(left, windows_.sequence().width - tile_pixels), half = windows_.half();
  T* const tile = reinterpret_cast<T*>(scratch.tile.data());
  std::vector<Scratch::Ready>& ready = scratch.ready;
  RowsOf<T> copy;
  while (!ready.empty()) {
    const int first = std::ranges::min(ready, {}, &Scratch::Ready::centre).centre;
    const auto is_near = [first](const Scratch::Ready& pixel) { return pixel.centre <= first + most_apart; };
    int last = first;
    for (const auto& pixel : ready)
      if (is_near(pixel)) last = std::max(last, pixel.centre);
    const auto around = rows_around(rows, step.begin, first - half, last + half + 1, copy);
    const std::size_t stride = (around.size() + tile_pixels - 1) / tile_pixels * tile_pixels;
    transpose_rows(around, tile_left, tile, stride);
    for (const auto& pixel : ready)
      if (is_near(pixel))
        std::memcpy(windows_.gray<T>(pixel.x, y),
                    tile + static_cast<std::size_t>(pixel.x - tile_left) * stride + (pixel.centre - first),
                    static_cast<std::size_t>(windows_.length()) * sizeof(T));
    std::erase_if(ready, is_near);
  }
}

}  // namespace pagesweep
