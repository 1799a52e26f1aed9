// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cli/command.h"
#include "cli/console_progress.h"
#include "cli/output_folder.h"
#include "pagesweep/pipeline/results.h"
#include "pagesweep/pipeline/scan_page.h"
#include "pagesweep/report/report.h"

namespace pagesweep::cli {

/// When a page's quality ends the program with exit code 7.
enum class FailOn { never, scan_again, look };
constexpr auto names_of(FailOn) { return std::array<std::string_view, 3>{"never", "scan_again", "look"}; }

struct QualityArguments {
  FailOn fail_on = FailOn::never;
  template <class Visitor>
  void describe(Visitor&& visit) {
    visit("fail-on", fail_on, "",
          "exit with code 7 if a page's verdict is scan_again, or look as well; all files are written all the same");
  }
};

/// What a finished run can tell. What it has not is left empty.
struct RunResult {
  std::string title;
  std::vector<Sequence> sequences;  ///< of the cameras, if frames were read
  const Measurement& measurement;
  std::span<const PageSurface> surfaces = {};
  std::span<const Page> pages = {};
  const Picture* scan = nullptr;
  ResampleKernel kernel = ResampleKernel::lanczos3;  ///< that pages were made with
  FailOn fail_on = FailOn::never;
  std::vector<OptionValue> options = {};
  std::vector<Figure> figures = {};  ///< more than the measurement tells
};

/// The options of the measuring stations, and those of the flattening ones, as they were used.
void add_measuring_options(std::vector<OptionValue>& values, const ScanOptions& options);
void add_flattening_options(std::vector<OptionValue>& values, const ScanOptions& options);

/// A whole scan that is done, of a capture or of live cameras.
struct ScanResult {
  std::string title;
  const std::vector<Sequence>& sequences;
  const Scan& scan;
  const Picture* picture = nullptr;  ///< null: none came, and there are no pages
  const ScanOptions& options;
  const PageFileOptions& files;
  FailOn fail_on = FailOn::never;
  std::vector<Figure> figures = {};  ///< more than the measurement tells
};

/// Writes all that a scan has found, and the report.
void write_scan(OutputFolder& output, const ScanResult& result, ConsoleProgress& progress,
                const CommonOptions& options);

/// Writes the report, which completes the output folder, and answers with what it says.
void finish_result(OutputFolder& output, const RunResult& result, ConsoleProgress& progress,
                   const CommonOptions& options);

}  // namespace pagesweep::cli
