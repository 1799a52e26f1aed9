// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "pagesweep/io/capture_file.h"
#include "pagesweep/live/live_source.h"

namespace pagesweep {

/// What a disk has to be good for.
struct RecorderLimits {
  std::uintmax_t least_space = std::uintmax_t{64} << 20;  ///< [bytes] to be left on it, for all that is not frames
  int triggers_of_a_sweep = 200;                          ///< for which there has to be room before the sweep
  std::size_t most_waiting = 200;                         ///< triggers to be stored; two seconds at 100 a second
  std::chrono::milliseconds delay{0};                     ///< that each trigger takes longer: a slow disk, for tests
};

/// Stores frames as they come, one recording a camera, in a thread of its own: what takes long on a disk delays nobody.
class CaptureRecorder {
 public:
  /// \param sequences  what is known of the cameras; counts do not matter
  /// \throws Error  if nothing can be written into the folder, or its disk has no room for a sweep
  CaptureRecorder(const std::filesystem::path& folder, const std::vector<Sequence>& sequences,
                  const RecorderLimits& limits = {});
  ~CaptureRecorder();

  /// The next trigger.
  /// \return whether it will be stored; if not, nothing after it will, see trouble()
  bool add(const FrameSet& set, const std::vector<Timestamp>& timestamps);
  /// Why not all was stored: the disk is full, or too slow. Empty: it was.
  std::string trouble() const;
  /// Waits until all is stored. Once, at the end.
  /// \return where the frames are, camera by camera
  /// \throws Error  if a recording cannot be finished, or there is none
  std::vector<SequenceFiles> finish();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// A live source that is recorded while its frames are used.
class RecordedSource : public FrameSource {
 public:
  /// Both must outlive this.
  /// \param ends_with_recorder  whether the sweep ends when the disk fails
  RecordedSource(LiveSource& live, CaptureRecorder& recorder, bool ends_with_recorder)
      : live_(live), recorder_(recorder), ends_with_recorder_(ends_with_recorder) {}

  const std::vector<Sequence>& sequences() const override { return live_.sequences(); }
  std::optional<FrameSet> next() override;

 private:
  LiveSource& live_;
  CaptureRecorder& recorder_;
  bool ends_with_recorder_;
  bool is_recording_ = true;
};

/// The capture.json of a recorded sweep.
Capture describe_capture(const std::filesystem::path& folder, std::vector<SequenceFiles> files, const LiveSource& live);

}  // namespace pagesweep
