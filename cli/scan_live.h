// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "cli/command.h"
#include "cli/live_input.h"
#include "cli/result_output.h"
#include "pagesweep/io/result_files.h"
#include "pagesweep/pipeline/results.h"
#include "pagesweep/pipeline/scan_page.h"

namespace pagesweep::cli {

/// `pagesweep scan --live`: what it is to do.
struct LiveScan {
  CommonOptions common;
  LiveInput input;
  std::filesystem::path rig, picture, record, output;  ///< picture, record: may be empty
  ScanOptions options;
  PageFileOptions files;
  QualityArguments quality;
};

/// Measures a sweep while it goes on, and flattens the pages when it has ended. What was measured is written even if a
/// camera fails, or no picture comes.
/// \throws Error  if nothing can be measured, and in the end if something was missing
void scan_live(const LiveScan& arguments);

}  // namespace pagesweep::cli
