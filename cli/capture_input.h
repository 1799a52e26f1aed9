// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>

#include "pagesweep/io/capture_file.h"
#include "pagesweep/io/rig_file.h"

namespace pagesweep::cli {

/// The recording that a command works on, and what replaces parts of it.
struct CaptureInput {
  std::filesystem::path capture;
  std::filesystem::path rig;      ///< empty: the one that the capture names
  std::filesystem::path picture;  ///< empty: likewise

  void add_to(CLI::App& command);
  void add_picture_to(CLI::App& command);
  /// The rig that belongs to `opened`.
  Rig rig_of(const Capture& opened) const { return rig.empty() ? read_capture_rig(opened) : read_rig(rig); }
  /// The scan that belongs to `opened`.
  /// \throws Error  if there is none
  std::filesystem::path picture_of(const Capture& opened) const;
};

struct OpenedCapture {
  Capture capture;
  Rig rig;
  std::unique_ptr<FrameSource> frames;
};

/// Name of a capture for people: that of its folder.
std::string title_of(const Capture& capture);

/// \throws Error  if capture, rig or frames cannot be used
OpenedCapture open(const CaptureInput& input);

}  // namespace pagesweep::cli
