// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/quiet_strips_internal.h"

#include <algorithm>
#include <array>
#include <cstddef>

namespace pagesweep {

QuietStrips::QuietStrips(int width, int height, int block)
    : width_(width),
      block_(block),
      lowest_rise_((width + strip_px - 1) / strip_px, height, -std::numeric_limits<float>::infinity()),
      latest_(lowest_rise_.width(), height, -1) {}

void QuietStrips::begin_step(int begin, int end, bool is_looked_at) {
  std::erase_if(steps_, [&](const Step& step) { return step.end <= begin - CoarseSearch::blocks_again * block_; });
  Step& step = steps_.emplace_back(Step{begin, end, {}, {}});
  if (!is_looked_at) return;
  step.low = Image<std::uint16_t>(lowest_rise_.width(), lowest_rise_.height());
  step.high = step.low;
}

template <class T>
void QuietStrips::note_rows(Step& step, int y, std::span<const T* const> rows) {
  for (int strip = 0; strip < count(); ++strip) {
    const int left = strip * strip_px;
    const auto columns = static_cast<std::size_t>(std::min(strip_px, width_ - left));
    std::array<T, strip_px> low, high;
    low.fill(std::numeric_limits<T>::max());
    high.fill(0);
    for (const T* row : rows)
      for (std::size_t x = 0; x < columns; ++x) {
        const T gray = row[static_cast<std::size_t>(left) + x];
        low[x] = gray < low[x] ? gray : low[x];
        high[x] = gray > high[x] ? gray : high[x];
      }
    T lowest = std::numeric_limits<T>::max(), highest = 0;
    for (std::size_t x = 0; x < columns; ++x) {
      lowest = low[x] < lowest ? low[x] : lowest;
      highest = high[x] > highest ? high[x] : highest;
    }
    step.low(strip, y) = lowest;
    step.high(strip, y) = highest;
  }
}

void QuietStrips::note(int y, const RawRow& rows, int first_frame) {
  Step& step = steps_.back();
  const auto first = static_cast<std::size_t>(step.begin - first_frame);
  std::visit(
      [&]<class T>(const RowsOf<T>& all) { note_rows<T>(step, y, std::span<const T* const>(all).subspan(first)); },
      rows);
}

bool QuietStrips::is_quiet(int strip, int y, const CoarseSearch::Step& step) const {
  if (latest_(strip, y) >= step.first_place - 1) return false;  // what follows a highest response is kept, too
  int low = std::numeric_limits<int>::max(), high = 0, known_from = low;
  for (const Step& seen : steps_) {
    if (seen.end <= step.first_block * block_) continue;
    if (seen.low.empty()) return false;
    known_from = std::min(known_from, seen.begin);
    low = std::min<int>(low, seen.low(strip, y));
    high = std::max<int>(high, seen.high(strip, y));
  }
  return known_from <= step.first_block * block_ &&
         static_cast<float>(4 * block_ * (high - low)) < lowest_rise_(strip, y);
}

void QuietStrips::keep(int strip, int y, const CoarseSearch& search) {
  const int left = strip * strip_px;
  const Extremes extremes = search.extremes(y, left, std::min(strip_px, width_ - left));
  lowest_rise_(strip, y) = extremes.lowest_rise;
  latest_(strip, y) = extremes.latest_best;
}

int QuietStrips::highest(int y) const {
  int highest = 0;
  for (const std::uint16_t high : steps_.back().high.row(y)) highest = std::max<int>(highest, high);
  return highest;
}

}  // namespace pagesweep
