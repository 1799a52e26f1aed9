// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/sequence_landings.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>

#include "pagesweep/base/parallel.h"

namespace pagesweep {

SequenceLandings::SequenceLandings(const SequenceStore& from, const SequenceStore& there)
    : from_(from.arrays()),
      there_(there.arrays()),
      steps_(static_cast<int>(std::bit_floor(half / static_cast<std::uint32_t>(from_.places + 4)))) {
  const auto stride = static_cast<std::size_t>(there_.stride);
  cells_ = std::make_unique_for_overwrite<std::uint32_t[]>(static_cast<std::size_t>(there_.lines + 2) * stride);
  parallel_ranges(there_.lines + 2, 64, [&](int begin, int end) {
    std::fill(&cells_[static_cast<std::size_t>(begin) * stride], &cells_[static_cast<std::size_t>(end) * stride], 0);
  });
}

SequenceLandings::Landing SequenceLandings::landing(double x, double y) const {
  const double along = there_.along_rows ? x : y, across = there_.along_rows ? y : x;
  const int place = static_cast<int>(std::lround(along)), line = static_cast<int>(std::lround(across));
  if (place < 0 || line < 0 || place >= there_.places || line >= there_.lines) return {0, 0};
  return {static_cast<std::size_t>(there_.index(line + 1, place + 1)), along - place};
}

std::uint32_t SequenceLandings::step_at(double place) const {
  return static_cast<std::uint32_t>(std::lround(std::clamp((place + 2) * steps_, 1.0, half - 1.0)));
}

void SequenceLandings::widen(const Landing& landing, double first, double last) {
  // A step of one picture is about a step of the other.
  const std::uint32_t before_end = half - step_at(first - landing.beyond_place);
  const std::uint32_t from_start = step_at(last - landing.beyond_place);
  const std::atomic_ref<std::uint32_t> cell(cells_[landing.cell]);
  std::uint32_t known = cell.load(std::memory_order_relaxed), wider = 0;
  do {
    wider = std::max(known >> 16, before_end) << 16 | std::max(known & half, from_start);
  } while (wider != known && !cell.compare_exchange_weak(known, wider, std::memory_order_relaxed));
}

std::optional<float> SequenceLandings::origin(std::int32_t index) const {
  const int at = index + there_.stride + 1, most_apart = 5 * steps_ / 2;  // on a surface that is steep
  int first = 2 * static_cast<int>(half), last = -first;
  const auto take = [&](int cell, int places_before) {
    const std::uint32_t places = cells_[static_cast<std::size_t>(cell)];
    if (places == 0) return;
    const int shift = places_before * steps_;
    first = std::min(first, static_cast<int>(half - (places >> 16)) + shift);
    last = std::max(last, static_cast<int>(places & half) + shift);
  };
  take(at - there_.stride, 0);
  take(at + there_.stride, 0);
  take(at - 1, 1);
  take(at + 1, -1);
  take(at, 0);
  if (first > last || last - first > most_apart) return std::nullopt;
  const std::uint32_t here = cells_[static_cast<std::size_t>(at)];
  const int twice_middle =
      here == 0 ? first + last : static_cast<int>(half - (here >> 16)) + static_cast<int>(here & half);
  return static_cast<float>(twice_middle) / static_cast<float>(2 * steps_) - 2;
}

}  // namespace pagesweep
