// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "pagesweep/data/frames.h"
#include "pagesweep/data/trigger_times.h"
#include "pagesweep/live/genicam_camera.h"
#include "pagesweep/live/sweep_watch.h"

namespace pagesweep {

/// How a sweep is awaited.
struct LiveOptions {
  double wait_s = 60;
  double longest_s = 300;

  template <class Visitor>
  void describe(Visitor&& visit) {
    visit("wait", wait_s, "s", "give up if no stripe of light comes within that time");
    visit("longest", longest_s, "s", "end a sweep that takes longer");
  }
};

/// What an operator wants to see of a running sweep.
struct LiveStatus {
  struct Camera {
    std::string name;
    double rate_hz = 0;
    FrameCounts counts;
    std::optional<SweepWatch::Position> stripe;
  };
  SweepWatch::State state = SweepWatch::State::waiting;
  std::vector<Camera> cameras;
  int frames = 0;                    ///< instants of the sweep so far
  std::vector<std::string> remarks;  ///< new since the last status
};

/// The frames of one sweep from live cameras: waits for the stripe, yields every trigger from shortly before it comes
/// until it has left, and ends.
///
/// A trigger that no camera saw leaves its index out; a frame that was damaged or lost is absent from its set. A camera
/// that falls silent for 0.8 s while others go on ends the sweep; so does a sweep that takes too long, and a computer
/// that cannot keep up. What was measured until then is good: ended_early() tells.
class LiveSource : public FrameSource {
 public:
  /// \param sequences  of the cameras, without their counts
  /// \param observe    is called a few times a second from next(); an exception ends the run
  LiveSource(std::vector<std::unique_ptr<GenicamCamera>> cameras, std::vector<Sequence> sequences,
             const LiveOptions& options = {}, std::function<void(const LiveStatus&)> observe = {});
  ~LiveSource() override;

  const std::vector<Sequence>& sequences() const override;
  /// \throws Error  before the sweep: if a camera sends nothing, or no stripe comes
  std::optional<FrameSet> next() override;

  /// Of the set that next() gave last, by each camera's clock.
  const std::vector<Timestamp>& timestamps() const;
  /// When the last frame of that set had come from the network.
  Clock::time_point last_arrival() const;
  double interval_ns() const;
  /// What each camera was set to.
  const DeviceSettings& settings(std::size_t camera) const;
  /// Whether the cameras are triggered together.
  bool is_triggered() const;
  /// Why the sweep is not whole; empty: it is.
  const std::string& ended_early() const;
  /// Final after the last frame.
  LiveStatus status() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace pagesweep
