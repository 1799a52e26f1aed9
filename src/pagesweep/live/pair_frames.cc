// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/live/pair_frames.h"

#include <algorithm>
#include <limits>

namespace pagesweep {
namespace {

constexpr std::size_t frames_to_learn = 12;  ///< of each camera: some of them were not held up on their way
constexpr auto longest_wait = std::chrono::milliseconds(250);  ///< for a partner that may still be on its way
constexpr std::int64_t highest_short_id = 65535;

std::int64_t nanoseconds(Clock::time_point time) {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(time.time_since_epoch()).count();
}

}  // namespace

std::int64_t FrameCounter::count(std::uint64_t id) {
  const auto own = static_cast<std::int64_t>(id);
  std::int64_t ahead = last_ ? own - *last_ : 0;
  if (std::max(own, last_.value_or(0)) <= highest_short_id) {
    if (ahead < -highest_short_id / 2) ahead += highest_short_id;
    if (ahead > highest_short_id / 2) ahead -= highest_short_id;
  }
  const std::int64_t count = latest_ + ahead;
  if (!last_ || ahead > 0) last_ = own, latest_ = count;
  return count;
}

FramePairing::FramePairing(std::size_t cameras, double interval_ns)
    : interval_ns_(interval_ns),
      queues_(cameras),
      fastest_ns_(cameras, std::numeric_limits<std::int64_t>::max()),
      first_stamps_(cameras),
      ahead_ns_(cameras, 0),
      counts_(cameras) {}

void FramePairing::add(std::size_t camera, LiveFrame frame) {
  ++counts_[camera].received;
  if (!is_ready_) {
    fastest_ns_[camera] = std::min(fastest_ns_[camera], nanoseconds(frame.arrival) - frame.timestamp_ns);
    first_stamps_[camera].push_back(frame.timestamp_ns);
  }
  queues_[camera].push_back(std::move(frame));
  if (!is_ready_) learn_clocks();
}

void FramePairing::learn_clocks() {
  for (const auto& stamps : first_stamps_)
    if (stamps.size() < frames_to_learn) return;
  if (interval_ns_ <= 0) interval_ns_ = usual_interval_ns(first_stamps_[0]);
  for (std::size_t c = 1; c < ahead_ns_.size(); ++c) {
    const std::int64_t about = fastest_ns_[0] - fastest_ns_[c];
    // The nearest pairs of stamps tell to the nanosecond what arrivals told to a millisecond.
    std::vector<std::int64_t> differences;
    for (const std::int64_t own : first_stamps_[c]) {
      const auto distance = [&](std::int64_t other) { return std::abs(own - other - about); };
      const std::int64_t nearest = *std::ranges::min_element(first_stamps_[0], {}, distance);
      if (static_cast<double>(distance(nearest)) < 0.5 * interval_ns_) differences.push_back(own - nearest);
    }
    std::ranges::sort(differences);
    ahead_ns_[c] = differences.empty() ? about : differences[differences.size() / 2];
  }
  is_ready_ = true;
  first_stamps_.clear();
}

std::size_t FramePairing::waiting() const {
  std::size_t most = 0;
  for (const auto& queue : queues_) most = std::max(most, queue.size());
  return most;
}

std::optional<Trigger> FramePairing::next(Clock::time_point now, bool ended) {
  if (!is_ready_) return std::nullopt;
  std::int64_t first_ns = std::numeric_limits<std::int64_t>::max();
  Clock::time_point arrival = now;
  for (std::size_t c = 0; c < queues_.size(); ++c) {
    if (queues_[c].empty()) continue;
    const std::int64_t here = common_ns(c, queues_[c].front());
    if (here < first_ns) arrival = queues_[c].front().arrival;
    first_ns = std::min(first_ns, here);
  }
  if (first_ns == std::numeric_limits<std::int64_t>::max()) return std::nullopt;
  const auto belongs = [&](std::size_t c) {
    return !queues_[c].empty() && static_cast<double>(common_ns(c, queues_[c].front()) - first_ns) < 0.5 * interval_ns_;
  };
  for (std::size_t c = 0; c < queues_.size(); ++c)
    if (queues_[c].empty() && !ended && now - arrival < longest_wait) return std::nullopt;
  Trigger trigger;
  std::size_t seen = 0;
  std::int64_t reference = no_time;
  for (std::size_t c = 0; c < queues_.size(); ++c) {
    trigger.frames.emplace_back();
    if (!belongs(c)) continue;
    trigger.frames[c] = std::move(queues_[c].front());
    queues_[c].pop_front();
    ++seen;
    if (c == 0) reference = trigger.frames[0]->timestamp_ns;
    if (c > 0 && reference != no_time) ahead_ns_[c] = trigger.frames[c]->timestamp_ns - reference;
  }
  // Half a beat after the last one: its partner, held up for too long.
  const bool is_late = last_ns_ != no_time && static_cast<double>(first_ns - last_ns_) < 0.5 * interval_ns_;
  for (std::size_t c = 0; c < queues_.size(); ++c) {
    if (!trigger.frames[c]) continue;
    if (is_late)
      ++counts_[c].late;
    else if (seen < queues_.size())
      ++counts_[c].unpaired;
  }
  if (is_late) return next(now, ended);
  last_ns_ = first_ns;
  return trigger;
}

}  // namespace pagesweep
