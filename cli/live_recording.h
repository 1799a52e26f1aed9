// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "cli/live_input.h"
#include "cli/output_folder.h"
#include "pagesweep/live/record_capture.h"

namespace pagesweep::cli {

/// The scanner's picture of a live sweep, which is waited for once, when it is asked for.
class LatePicture {
 public:
  /// \param scanner  that it comes from; null: it is in the file, or there is none
  LatePicture(ScanPictureSource* scanner, std::filesystem::path file = {})
      : scanner_(scanner), file_(std::move(file)) {}

  /// \return null if none comes, see problem()
  const Picture* get();
  const std::string& problem() const { return problem_; }

 private:
  ScanPictureSource* scanner_;
  std::filesystem::path file_;
  std::optional<Picture> picture_;
  bool is_asked_ = false;
  std::string problem_;
};

/// A live sweep that is recorded into a folder, which becomes a capture.
class LiveRecording {
 public:
  /// Makes the folder.
  /// \throws Error  if it cannot be made, or holds a capture, which is never overwritten
  explicit LiveRecording(const std::filesystem::path& folder);

  /// \param ends_with_disk  whether the sweep ends if the disk is full or too slow, or goes on without being recorded
  /// \return the frames, which are recorded as they are taken
  /// \throws Error  if the disk has no room for a sweep
  FrameSource& begin(OpenedRig& opened, bool ends_with_disk);
  /// When the sweep is over: stores what makes the folder a capture.
  /// \param problem  why the sweep, or its picture, is not whole; empty: it is
  /// \return as it was written
  /// \throws Error  if no frame was recorded, or it cannot be written
  Capture finish(const Rig& rig, const Picture* picture, const std::string& problem);
  /// Why the recording is less than the sweep was; empty: it is not.
  std::string trouble() const { return recorder_->trouble(); }
  const std::filesystem::path& path() const { return output_.path(); }

 private:
  OutputFolder output_;
  const OpenedRig* opened_ = nullptr;
  std::optional<CaptureRecorder> recorder_;
  std::optional<RecordedSource> source_;
};

/// Both in one sentence; either may be empty.
std::string join_problems(const std::string& first, const std::string& second);

}  // namespace pagesweep::cli
