// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "pagesweep/data/frame_beat.h"

namespace pagesweep {

/// When one camera's clock said a frame was exposed [ns]; nothing if there is no such frame.
using Timestamp = std::optional<std::int64_t>;

/// Puts the frames of several cameras on one beat, trigger by trigger, as they come.
///
/// One trigger has one time, that of the first camera that saw it: clocks of cameras are set at different times and run
/// at slightly different rates, and what is left of that must not become a shift between pictures that were taken at
/// once. Another camera's time is told from the last trigger that it saw together with the first one. Cameras that run
/// freely are not triggered together; their timestamps must be of one clock, and each frame keeps its own time.
class TriggerTimes {
 public:
  /// \param common  a trigger that all cameras saw, which sets their clocks at first; absent ones count as equal
  TriggerTimes(double interval_ns, bool is_triggered, std::span<const Timestamp> common);

  struct Place {
    int index = 0;            ///< instant of the beat
    std::vector<float> late;  ///< see FrameSet::late
  };
  /// The next trigger. The first one is at instant 0.
  /// \return nothing if no camera saw it, or time did not go on; see FrameBeat::place()
  std::optional<Place> place(std::span<const Timestamp> stamps);

  double interval_ns() const { return beat_.interval_ns(); }

 private:
  Timestamp time_of(std::span<const Timestamp> stamps) const;

  FrameBeat beat_;
  bool is_triggered_;
  std::vector<std::int64_t> ahead_ns_;  ///< of each camera's clock, before the first one's
};

}  // namespace pagesweep
