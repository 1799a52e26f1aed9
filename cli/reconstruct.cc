// SPDX-License-Identifier: Apache-2.0
// pagesweep reconstruct: frames to points, without a scan and without pages.
#include "cli/capture_input.h"
#include "cli/command.h"
#include "cli/console_progress.h"
#include "cli/option_visitor.h"
#include "cli/output_folder.h"
#include "cli/result_output.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/pipeline/results.h"

namespace pagesweep::cli {
namespace {

struct Arguments {
  CommonOptions common;
  CaptureInput input;
  std::filesystem::path output;
  ScanOptions options;
};

void run(const Arguments& arguments) {
  const ThreadLimit limit(arguments.common.threads);
  ConsoleProgress progress(arguments.common.quiet);
  OutputFolder output(arguments.output, "report.json");
  const OpenedCapture opened = open(arguments.input);
  const Measurement measurement = reconstruct(*opened.frames, opened.rig, arguments.options, progress);

  progress.begin("writing the points");
  output.begin();
  write_measurement(output.path(), measurement);
  RunResult result{
      .title = title_of(opened.capture), .sequences = opened.frames->sequences(), .measurement = measurement};
  add_measuring_options(result.options, arguments.options);
  finish_result(output, result, progress, arguments.common);
}

}  // namespace

void add_reconstruct_command(CLI::App& app) {
  auto* command = app.add_subcommand("reconstruct", R"(Measure the surface that two cameras see: frames to points.

Works on a moving stripe (--matcher time), on any sequence of projected patterns (--matcher
sequence), and with a single camera whose rig knows the sheet of light (--matcher light-
section). Writes points.ply, and for each camera maps of points, standard deviations, times and
of the reason why a pixel has no point.
)");
  const auto arguments = std::make_shared<Arguments>();
  arguments->input.add_to(*command);
  add_output(*command, arguments->output, "where the result goes");
  arguments->options.describe_measurement(OptionVisitor(*command, "Measuring"));
  add_common_options(*command, arguments->common);
  command->footer(R"(Examples:
  pagesweep reconstruct capture -o result
  pagesweep reconstruct gray_code_capture --matcher sequence -o result
)");
  command->callback([arguments] { run(*arguments); });
}

}  // namespace pagesweep::cli
