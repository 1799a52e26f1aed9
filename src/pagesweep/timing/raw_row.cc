// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstddef>

#include "pagesweep/timing/raw_row_internal.h"

namespace pagesweep {
namespace {

int first_frame(const Frames& frames) {
  int first = 0;
  while (first < frames.count() && !frames.has(first)) ++first;
  return first;
}

template <class T>
RowsOf<T> rows_of(const Frames& frames, int y, int pad) {
  RowsOf<T> rows;
  rows.reserve(static_cast<std::size_t>(frames.count() + 2 * pad));
  int shown = first_frame(frames);
  for (int i = -pad; i < frames.count() + pad; ++i) {
    if (i >= 0 && i < frames.count() && frames.has(i)) shown = i;
    rows.push_back(std::get<Image<T>>(frames.frame(shown)).row(y).data());
  }
  return rows;
}

}  // namespace

bool are_uniform(const Frames& frames) {
  const int first = first_frame(frames);
  if (first == frames.count()) return false;
  for (int i = first; i < frames.count(); ++i)
    if (frames.has(i) && frames.frame(i).index() != frames.frame(first).index()) return false;
  const std::vector<double>& exposures = frames.sequence().exposures;
  return std::ranges::all_of(exposures, [](double exposure) { return exposure == 1; });
}

RawRow raw_row(const Frames& frames, int y, int pad) {
  if (frames.frame(first_frame(frames)).index() == 0) return rows_of<std::uint8_t>(frames, y, pad);
  return rows_of<std::uint16_t>(frames, y, pad);
}

}  // namespace pagesweep
