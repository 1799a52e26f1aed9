// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "pagesweep/base/progress.h"
#include "pagesweep/timing/estimate_times.h"

namespace pagesweep {

class StripeLearner;

/// Time values while the frames arrive: as estimate_times(), to the last bit, without ever holding the whole sequence.
///
/// The first frames are kept until enough pixels have seen the stripe pass to learn it. From then on only the frames
/// that windows around the stripe still need are kept, and for each pixel its window; the stripe is followed by the
/// time values of what it has left. Sequences of several exposures, and other estimators than `refined`, need all
/// frames and are estimated at the end.
class TimeStream {
 public:
  /// \throws std::invalid_argument  if there is no camera
  explicit TimeStream(const std::vector<Sequence>& sequences, const TimingOptions& options = {});
  TimeStream(TimeStream&&) noexcept;
  ~TimeStream();

  /// The next instant. Indices grow; what they leave out was dropped.
  /// \throws std::invalid_argument  if a frame does not fit its sequence
  void add(FrameSet set);

  /// [frames] Pixels of all cameras that the stripe passed before have their times, but for those that hardly show it.
  /// What is known may still change a little where more light comes later. Minus infinity: nothing is known yet.
  double known_until() const;
  /// A camera's times so far. \pre known_until() is finite
  const TimeMap& so_far(std::size_t camera) const;

  /// When the last frame is there. Once.
  /// \param count  of the instants, where it was not known before; see FrameSource::sequences()
  /// \throws Error no_result  if no stripe passes
  Timing finish(Progress& progress = no_progress(), std::optional<int> count = std::nullopt);

  /// In how many frames each pixel of a camera is clipped (255: that many or more). After finish().
  Image<std::uint8_t> clipped_frames(std::size_t camera) const {
    return follows_ ? clipped_[camera] : count_clipped(frames_[camera]);
  }
  /// How many frames of a camera have not come so far.
  int dropped_frames(std::size_t camera) const { return frames_[camera].count() - arrived_[camera]; }
  /// How many frames of all cameras are kept at the moment.
  int frames_kept() const;

 private:
  struct Learned;
  void learn(int end);
  void follow_camera(std::size_t c);
  void look(std::size_t c, int end);

  TimingOptions options_;
  bool follows_ = false;  ///< else all frames are kept
  std::vector<Frames> frames_;
  std::vector<int> arrived_;                ///< frames of each camera
  int next_lesson_ = 0;                     ///< [frames]
  int looked_at_ = 0;                       ///< [frames]
  std::unique_ptr<StripeLearner> learner_;  ///< until then
  std::unique_ptr<Learned> learned_;
  std::vector<Image<std::uint8_t>> clipped_;
};

}  // namespace pagesweep
