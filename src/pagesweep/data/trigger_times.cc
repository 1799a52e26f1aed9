// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/data/trigger_times.h"

#include <algorithm>
#include <cstddef>

namespace pagesweep {

TriggerTimes::TriggerTimes(double interval_ns, bool is_triggered, std::span<const Timestamp> common)
    : beat_(interval_ns), is_triggered_(is_triggered), ahead_ns_(common.size(), 0) {
  if (is_triggered && !common.empty() && common[0])
    for (std::size_t c = 0; c < common.size(); ++c)
      if (common[c]) ahead_ns_[c] = *common[c] - *common[0];
}

Timestamp TriggerTimes::time_of(std::span<const Timestamp> stamps) const {
  for (std::size_t c = 0; c < stamps.size(); ++c)
    if (stamps[c]) return *stamps[c] - ahead_ns_[c];
  return std::nullopt;
}

std::optional<TriggerTimes::Place> TriggerTimes::place(std::span<const Timestamp> stamps) {
  const Timestamp time = time_of(stamps);
  if (!time) return std::nullopt;
  const auto on_beat = beat_.place(*time);
  if (!on_beat) return std::nullopt;
  Place place{on_beat->index, std::vector<float>(stamps.size(), static_cast<float>(on_beat->late))};
  for (std::size_t c = 0; c < stamps.size(); ++c) {
    if (!stamps[c]) continue;
    if (!is_triggered_)
      place.late[c] = static_cast<float>(beat_.time_of(*stamps[c]) - on_beat->index);
    else if (stamps[0])
      ahead_ns_[c] = *stamps[c] - *stamps[0];
  }
  if (std::ranges::all_of(place.late, [](float frames) { return frames == 0; })) place.late.clear();
  return place;
}

}  // namespace pagesweep
