// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/data/frame_beat.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace pagesweep {
namespace {

constexpr double clock_resolution = 1e-4;  // [instants] nobody could tell
constexpr double most_instants = 1e6;      // hours of frames: a clock that was set

}  // namespace

FrameBeat::FrameBeat(double interval_ns) : interval_ns_(interval_ns) {
  if (!(interval_ns > 0)) throw std::invalid_argument("FrameBeat: the interval must be above 0");
}

double FrameBeat::time_of(std::int64_t timestamp_ns) const {
  return static_cast<double>(timestamp_ns - first_.value_or(timestamp_ns)) / interval_ns_;
}

std::optional<FrameBeat::Place> FrameBeat::place(std::int64_t timestamp_ns) {
  if (!first_) first_ = timestamp_ns;
  if (last_ && timestamp_ns <= *last_) return std::nullopt;
  const double time = time_of(timestamp_ns);
  if (time > most_instants) return std::nullopt;
  last_ = timestamp_ns;
  last_index_ = std::max(last_index_ + 1, static_cast<int>(std::lround(time)));
  const double late = time - last_index_;
  return Place{last_index_, std::abs(late) < clock_resolution ? 0 : late};
}

double usual_interval_ns(std::span<const std::int64_t> timestamps_ns) {
  std::vector<double> intervals;
  for (std::size_t i = 1; i < timestamps_ns.size(); ++i)
    intervals.push_back(static_cast<double>(timestamps_ns[i] - timestamps_ns[i - 1]));
  if (intervals.empty()) return 0;
  const auto middle = intervals.begin() + static_cast<std::ptrdiff_t>((intervals.size() - 1) / 2);
  std::nth_element(intervals.begin(), middle, intervals.end());
  return *middle;
}

}  // namespace pagesweep
