// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/raw_row_internal.h"

#include <cstddef>

namespace pagesweep {
namespace {

template <class T>
RowsOf<T> rows_of(const Frames& frames, int y, int begin, int end) {
  RowsOf<T> rows;
  rows.reserve(static_cast<std::size_t>(end - begin));
  int shown = begin;
  while (!frames.has(shown)) ++shown;
  for (int i = begin; i < end; ++i) {
    if (frames.has(i)) shown = i;
    rows.push_back(std::get<Image<T>>(frames.frame(shown)).row(y).data());
  }
  return rows;
}

}  // namespace

RawRow raw_row(const Frames& frames, int y, int begin, int end) {
  if (frames.sequence().is_8_bit()) return rows_of<std::uint8_t>(frames, y, begin, end);
  return rows_of<std::uint16_t>(frames, y, begin, end);
}

}  // namespace pagesweep
