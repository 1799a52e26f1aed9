// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "pagesweep/camera/rig.h"
#include "pagesweep/data/frames.h"

namespace pagesweep {

/// Where a camera's frames lie: each in a file of its own, frame i in the one whose number is first + i, or all in a
/// recording, page by page.
struct SequenceFiles {
  std::string camera;       ///< a camera of the rig
  std::string frames;       ///< path with one %d or %06d for the number: "cam1/%06d.png"; empty: there is a recording
  int first = 0;            ///< number of frame 0's file
  int count = 0;            ///< frame instants; a file that is missing is a dropped frame
  int bit_depth = 8;        ///< of the gray values: 1 to 16
  double black_level = 0;   ///< gray value without light
  double saturation = 255;  ///< first gray value that is clipped
  /// Exposure times from frame 0 on: one a frame, or fewer that repeat. Empty: not known, and all alike.
  std::vector<double> exposure_ms = {};
  std::filesystem::path recording = {};  ///< see RecordingReader; empty: the frames are files
  std::vector<int> dropped = {};         ///< frames without a page in the recording, in ascending order
  /// When each frame was exposed, by the camera's own clock; `no_timestamp` for frames that are not there. Empty:
  /// evenly.
  std::vector<std::int64_t> timestamps_ns = {};
};

inline constexpr std::int64_t no_timestamp = std::numeric_limits<std::int64_t>::min();

/// A recorded sweep (docs/formats.md, "Capture"). Its paths are as given: absolute, or relative to `folder`.
struct Capture {
  std::filesystem::path folder;  ///< where capture.json lies
  std::filesystem::path rig = "rig.json";
  std::vector<SequenceFiles> sequences;
  std::optional<std::filesystem::path> scan;  ///< the scanner's own picture
  std::string notes;
  double frame_interval_ns = 0;  ///< between frames that were triggered evenly; 0: as the timestamps usually have it
  bool is_triggered = true;      ///< frame i of all cameras was exposed at once, whatever their clocks say; else these
                                 ///< are one clock

  std::filesystem::path rig_path() const { return folder / rig; }
  std::optional<std::filesystem::path> scan_path() const;
  /// Path of one frame's file.
  /// \throws std::invalid_argument  if the sequence has no file a frame
  std::filesystem::path frame_path(const SequenceFiles& sequence, int i) const;
};

/// Reads a capture from its folder or from its capture.json.
/// \throws Error  that names file, field and what was expected
Capture read_capture(const std::filesystem::path& folder_or_file);

/// Writes capture.folder / "capture.json".
/// \throws Error  if it cannot be written
/// \throws std::invalid_argument  if a sequence names neither frames nor a recording
void write_capture(const Capture& capture);

/// The rig that a capture names.
Rig read_capture_rig(const Capture& capture);

/// Cameras of which only names and sizes are known, from the frames themselves: enough to open a capture that has no
/// rig yet.
/// \throws Error  if the frames cannot be read
Rig read_camera_sizes(const Capture& capture);

/// What Frames and the stations need to know of a sequence that `camera` recorded.
Sequence make_sequence(const SequenceFiles& files, const Camera& camera);

/// The frames of a capture from its files. A missing file is a dropped frame.
///
/// A thread of its own, which shares out the work as parallel_ranges() does, reads up to 16 instants ahead of next()
/// and waits there. It ends with the source, whether or not all frames were asked for. next() throws Error at the first
/// frame that is unreadable, cut short, not gray, or of another size or depth than announced, after all instants before
/// that; and again whenever it is called after that.
/// \throws Error  if the rig lacks a camera of the capture, all frames of one are missing, or a recording is not sound
std::unique_ptr<FrameSource> open_capture(const Capture& capture, const Rig& rig);

}  // namespace pagesweep
