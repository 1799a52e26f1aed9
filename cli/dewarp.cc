// SPDX-License-Identifier: Apache-2.0
// pagesweep dewarp: measured points to flat pages, without measuring again.
#include "cli/capture_input.h"
#include "cli/command.h"
#include "cli/console_progress.h"
#include "cli/memory.h"
#include "cli/option_visitor.h"
#include "cli/output_folder.h"
#include "cli/result_output.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/io/image_file.h"
#include "pagesweep/pipeline/results.h"

namespace pagesweep::cli {
namespace {

struct Arguments {
  CommonOptions common;
  std::filesystem::path result;
  CaptureInput input;
  std::filesystem::path output;
  ScanOptions options;
  PageFileOptions files;
  QualityArguments quality;
};

void run(const Arguments& arguments) {
  check(arguments.files);
  const ThreadLimit limit(arguments.common.threads);
  ConsoleProgress progress(arguments.common.quiet);
  OutputFolder output(arguments.output, "report.json");
  const Capture capture = read_capture(arguments.input.capture);
  const Rig rig = arguments.input.rig_of(capture);
  const std::filesystem::path picture_file = arguments.input.picture_of(capture);
  progress.begin("reading the points");
  Measurement measurement = read_measurement(arguments.result, rig);
  const Picture picture = read_picture(picture_file);
  const UnusedMemoryKept kept;
  const Scan scan = flatten(std::move(measurement), picture, rig, arguments.options, progress);

  progress.begin("writing the pages");
  output.begin();
  write_pages(output.path(), scan.pages, scan.surfaces, arguments.files,
              {title_of(capture), "pagesweep " PAGESWEEP_VERSION});
  RunResult result{.title = title_of(capture),
                   .sequences = {},
                   .measurement = scan.measurement,
                   .surfaces = scan.surfaces,
                   .pages = scan.pages,
                   .scan = &picture,
                   .kernel = arguments.options.dewarp.resampling.kernel,
                   .fail_on = arguments.quality.fail_on};
  add_flattening_options(result.options, arguments.options);
  finish_result(output, result, progress, arguments.common);
}

}  // namespace

void add_dewarp_command(CLI::App& app) {
  auto* command = app.add_subcommand("dewarp", R"(Make the pages anew from points that are measured already.

Takes the points from the result of an earlier scan or reconstruct, the rig and the scan from
the capture that they were measured in, and writes the pages as scan does. The frames are not
needed.
)");
  const auto arguments = std::make_shared<Arguments>();
  add_input(*command, "RESULT", arguments->result, "folder that scan or reconstruct wrote");
  arguments->input.add_to(*command);
  arguments->input.add_picture_to(*command);
  add_output(*command, arguments->output, "where the pages go; may be RESULT itself");
  arguments->options.describe_pages(OptionVisitor(*command, "Flattening"));
  arguments->files.describe(OptionVisitor(*command, "Files"));
  arguments->quality.describe(OptionVisitor(*command, "Quality"));
  add_common_options(*command, arguments->common);
  command->footer(R"(Examples:
  pagesweep dewarp result capture -o result                     # in place
  pagesweep dewarp result capture -o plain --no-difference-vector
  pagesweep dewarp result capture --picture infrared.tif -o infrared
)");
  command->callback([arguments] { run(*arguments); });
}

}  // namespace pagesweep::cli
