// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cli/live_view.h"
#include "pagesweep/camera/rig.h"
#include "pagesweep/live/live_source.h"
#include "pagesweep/live/scan_picture.h"

namespace pagesweep::cli {

/// The cameras that a sweep is to be taken with.
struct LiveInput {
  std::vector<std::string> cameras;  ///< "cam1=ID"
  std::string scanner;               ///< "line=ID" or "folder=DIR"; empty: none
  std::filesystem::path devices;     ///< empty: defaults
  LiveOptions options;

  void add_to(CLI::App& command);
};

/// Cameras that are set and send frames, and what takes the scanner's picture.
struct OpenedRig {
  Devices devices;  ///< as the cameras took them
  std::unique_ptr<LiveSource> source;
  std::unique_ptr<ScanPictureSource> scanner;  ///< null: none
};

/// \param rig   whose cameras have the names and sizes
/// \param view  is told what goes on
/// \throws Error  if a camera cannot be used
OpenedRig open(const LiveInput& input, const Rig& rig, LiveView& view);

}  // namespace pagesweep::cli
