// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "pagesweep/data/frames.h"

namespace pagesweep {

/// Sees the stripe of light come and go.
///
/// Looks at every eighth pixel of every eighth row, and takes for lit what is clearly brighter than the same pixel was
/// ever before. The stripe is there from when a part of the picture is lit until none has been for a while.
class SweepWatch {
 public:
  enum class State {
    waiting,  ///< no stripe so far
    sweeping,
    over,  ///< it has left
  };

  explicit SweepWatch(const std::vector<Sequence>& sequences);

  /// The next frames of all cameras.
  State look(const FrameSet& set);
  State state() const { return state_; }
  /// Where the stripe is in a camera's picture, as shares of its width and height; nothing if it is not there.
  struct Position {
    double x = 0, y = 0;
  };
  std::optional<Position> position(std::size_t camera) const { return cameras_[camera].position; }

 private:
  struct Camera {
    double threshold = 0;  ///< [gray values]
    Image<std::uint16_t> darkest;
    std::optional<Position> position;
  };
  bool look(Camera& camera, const GrayImage& image) const;

  std::vector<Camera> cameras_;
  State state_ = State::waiting;
  int lit_ = 0;   ///< frames in a row with a stripe
  int dark_ = 0;  ///< frames in a row without
};

/// Frames to keep before the first one that shows the stripe, and to wait for after the last: bells must end, and the
/// background be seen.
inline constexpr int frames_around_sweep = 40;

}  // namespace pagesweep
