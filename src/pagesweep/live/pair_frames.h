// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "pagesweep/data/trigger_times.h"
#include "pagesweep/live/live_frame.h"

namespace pagesweep {

/// The frames of all cameras that one trigger made.
struct Trigger {
  std::vector<std::optional<LiveFrame>> frames;  ///< one a camera
};

/// Unrolls a counter of frames that wraps from 65535 to 1, as that of GigE Vision does, or of 64 bit that does not.
class FrameCounter {
 public:
  /// \return frames since the first one; smaller than before for a frame that was overtaken
  std::int64_t count(std::uint64_t id);
  /// Frames from the first to the latest.
  std::int64_t total() const { return last_ ? latest_ + 1 : 0; }

 private:
  std::optional<std::int64_t> last_;  ///< id of the latest
  std::int64_t latest_ = 0;
};

/// Finds out which frames of several cameras belong to the same trigger.
///
/// Clocks of cameras start anywhere. A frame's fastest way to the computer takes much less than the time between two
/// triggers, so that the earliest arrivals tell how the clocks are set to within that; from then on timestamps alone
/// decide, and each trigger that was seen by all corrects for clocks that run apart. Frames whose partner was lost come
/// alone: their trigger is known.
class FramePairing {
 public:
  /// \param interval_ns  usual time between triggers; 0: to be measured
  FramePairing(std::size_t cameras, double interval_ns);

  /// Frames of a camera come in their order.
  void add(std::size_t camera, LiveFrame frame);
  /// The next trigger for which nothing more can come, in their order; nothing if one must wait.
  /// \param ended  no more frames will come
  std::optional<Trigger> next(Clock::time_point now, bool ended = false);
  /// Whether clocks are known well enough.
  bool is_ready() const { return is_ready_; }
  double interval_ns() const { return interval_ns_; }
  /// By how much a camera's clock is ahead of the first one's.
  std::int64_t ahead_ns(std::size_t camera) const { return ahead_ns_[camera]; }
  const std::vector<FrameCounts>& counts() const { return counts_; }
  /// Frames that wait for a partner.
  std::size_t waiting() const;

 private:
  void learn_clocks();
  std::int64_t common_ns(std::size_t camera, const LiveFrame& frame) const {
    return frame.timestamp_ns - ahead_ns_[camera];
  }

  double interval_ns_;
  bool is_ready_ = false;
  std::vector<std::deque<LiveFrame>> queues_;
  std::vector<std::int64_t> fastest_ns_;  ///< arrival less timestamp
  std::vector<std::vector<std::int64_t>> first_stamps_;
  std::vector<std::int64_t> ahead_ns_;
  std::int64_t last_ns_ = no_time;
  std::vector<FrameCounts> counts_;

  static constexpr std::int64_t no_time = INT64_MIN;
};

}  // namespace pagesweep
