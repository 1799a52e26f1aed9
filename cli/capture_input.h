// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>

#include "pagesweep/io/capture_file.h"

namespace pagesweep::cli {

/// The recording that a command works on, and what replaces parts of it.
struct CaptureInput {
  std::filesystem::path capture;
  std::filesystem::path rig;      ///< empty: the one that the capture names
  std::filesystem::path picture;  ///< empty: likewise

  void add_to(CLI::App& command);
  /// The scan that belongs to `opened`.
  /// \throws Error  if there is none
  std::filesystem::path picture_of(const Capture& opened) const;
};

struct OpenedCapture {
  Capture capture;
  Rig rig;
  std::unique_ptr<FrameSource> frames;
};

/// \throws Error  if capture, rig or frames cannot be used
OpenedCapture open(const CaptureInput& input);

}  // namespace pagesweep::cli
