// SPDX-License-Identifier: Apache-2.0
#include "cli/capture_input.h"

#include "cli/command.h"
#include "pagesweep/base/error.h"

namespace pagesweep::cli {

void CaptureInput::add_to(CLI::App& command) {
  add_input(command, "CAPTURE", capture, "folder with capture.json, or that file");
  command.add_option("--rig", rig, "use this rig instead of the one that the capture names")->option_text("<file>");
}

void CaptureInput::add_picture_to(CLI::App& command) {
  command.add_option("--picture", picture, "use this scan instead of the one that the capture names")
      ->option_text("<file>");
}

std::filesystem::path CaptureInput::picture_of(const Capture& opened) const {
  if (!picture.empty()) return picture;
  if (const auto named = opened.scan_path()) return *named;
  throw bad_input(opened.folder / "capture.json", "scan",
                  "no scan is named, and there is nothing to flatten: give one with --picture, or measure the surface "
                  "alone with `pagesweep reconstruct`");
}

std::string title_of(const Capture& capture) {
  std::error_code failure;
  return std::filesystem::weakly_canonical(capture.folder, failure).filename().string();
}

OpenedCapture open(const CaptureInput& input) {
  OpenedCapture opened;
  opened.capture = read_capture(input.capture);
  opened.rig = input.rig_of(opened.capture);
  opened.frames = open_capture(opened.capture, opened.rig);
  return opened;
}

}  // namespace pagesweep::cli
