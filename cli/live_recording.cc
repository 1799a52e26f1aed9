// SPDX-License-Identifier: Apache-2.0
#include "cli/live_recording.h"

#include <chrono>

#include "pagesweep/base/error.h"
#include "pagesweep/io/image_file.h"
#include "pagesweep/io/rig_file.h"

namespace pagesweep::cli {
namespace {

constexpr auto longest_wait_for_picture = std::chrono::milliseconds(2000);

std::filesystem::path without_capture(const std::filesystem::path& folder) {
  if (std::filesystem::exists(folder / "capture.json"))
    throw pagesweep::cannot_write(folder, "there is a capture already, which is never overwritten: name a new folder");
  return folder;
}

}  // namespace

const Picture* LatePicture::get() {
  if (!is_asked_ && (scanner_ || !file_.empty())) {
    is_asked_ = true;
    try {
      picture_ = scanner_ ? scanner_->finish(longest_wait_for_picture) : read_picture(file_);
    } catch (const Error& error) {
      problem_ = error.what();
    }
  }
  return picture_ ? &*picture_ : nullptr;
}

LiveRecording::LiveRecording(const std::filesystem::path& folder) : output_(without_capture(folder), "capture.json") {}

FrameSource& LiveRecording::begin(OpenedRig& opened, bool ends_with_disk) {
  opened_ = &opened;
  recorder_.emplace(output_.path(), opened.source->sequences());
  return source_.emplace(*opened.source, *recorder_, ends_with_disk);
}

Capture LiveRecording::finish(const Rig& rig, const Picture* picture, const std::string& problem) {
  Capture capture = describe_capture(output_.path(), recorder_->finish(), *opened_->source);
  std::string partial = join_problems(problem, recorder_->trouble());
  if (picture) try {
      write_picture(output_.path() / "scan.tif", *picture);
      capture.scan = "scan.tif";
    } catch (const Error& error) {  // frames alone can still be measured
      partial = join_problems(partial, error.what());
    }
  if (!partial.empty()) capture.notes = "partial: " + partial;
  write_rig(output_.path() / "rig.json", rig);
  write_devices(output_.path() / "devices.json", opened_->devices);
  write_capture(capture);
  output_.finish();
  return capture;
}

std::string join_problems(const std::string& first, const std::string& second) {
  return first.empty() || second.empty() ? first + second : first + "; " + second;
}

}  // namespace pagesweep::cli
