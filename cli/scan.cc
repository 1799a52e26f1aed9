// SPDX-License-Identifier: Apache-2.0
// pagesweep scan: the whole way, from a capture to flat pages.
#include <optional>

#include "cli/capture_input.h"
#include "cli/command.h"
#include "cli/console_progress.h"
#include "cli/memory.h"
#include "cli/option_visitor.h"
#include "cli/output_folder.h"
#include "cli/result_output.h"
#include "cli/scan_live.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/io/image_file.h"

namespace pagesweep::cli {
namespace {

struct Arguments {
  CommonOptions common;
  CaptureInput input;
  bool live = false;
  LiveInput cameras;
  std::filesystem::path record;
  std::filesystem::path output;
  ScanOptions options;
  PageFileOptions files;
  QualityArguments quality;
};

void run_live(const Arguments& arguments) {
  scan_live({arguments.common, arguments.cameras, arguments.input.rig, arguments.input.picture, arguments.record,
             arguments.output, arguments.options, arguments.files, arguments.quality});
}

void run(const Arguments& arguments) {
  check(arguments.files);
  if (arguments.live) return run_live(arguments);
  if (arguments.input.capture.empty()) throw CLI::ValidationError("CAPTURE", "name one, or take a sweep with --live");
  const ThreadLimit limit(arguments.common.threads);
  ConsoleProgress progress(arguments.common.quiet);
  OutputFolder output(arguments.output, "report.json");
  const OpenedCapture opened = open(arguments.input);
  const std::filesystem::path picture_file = arguments.input.picture_of(opened.capture);
  std::optional<Picture> picture;
  const auto read = [&]() -> const Picture& {
    if (!picture) picture = read_picture(picture_file);
    return *picture;
  };
  const Scan scan = [&] {
    Measurement measurement = reconstruct(*opened.frames, opened.rig, arguments.options, progress, ScanSource(read));
    const UnusedMemoryKept kept;
    return flatten(std::move(measurement), read(), opened.rig, arguments.options, progress);
  }();

  write_scan(output,
             {.title = title_of(opened.capture),
              .sequences = opened.frames->sequences(),
              .scan = scan,
              .picture = &read(),
              .options = arguments.options,
              .files = arguments.files,
              .fail_on = arguments.quality.fail_on},
             progress, arguments.common);
}

}  // namespace

void add_scan_command(CLI::App& app) {
  auto* command = app.add_subcommand("scan", R"(Measure the pages of a book and flatten them: the whole way.

Reads a capture (the frames of both cameras, the scanner's picture and the rig) and writes

  page_1.png, page_2.png   the flat pages from left to right, true to scale
  points.ply               the measured surface, for CloudCompare or MeshLab
  report.html              how well it was measured, and why anything is missing
  report.json              the same for programs
  page_N_scanmap.tiff      where in the scan each pixel of page N was taken from
  page_N_surface.tiff      the page's shape
  CAMERA_*.tiff            per camera pixel: point, standard deviation, time, reason why it has none
)");
  const auto arguments = std::make_shared<Arguments>();
  arguments->input.add_to(*command);
  arguments->input.add_picture_to(*command);
  add_output(*command, arguments->output, "where the result goes");
  command->get_option("CAPTURE")->required(false);
  command->add_flag("--live", arguments->live, "measure a sweep of live cameras while it goes on")->group("Live");
  command->add_option("--record", arguments->record, "keep the frames as a capture there")
      ->option_text("<folder>")
      ->group("Live");
  arguments->cameras.add_to(*command);
  arguments->options.describe_measurement(OptionVisitor(*command, "Measuring"));
  arguments->options.describe_pages(OptionVisitor(*command, "Flattening"));
  arguments->files.describe(OptionVisitor(*command, "Files"));
  arguments->quality.describe(OptionVisitor(*command, "Quality"));
  add_common_options(*command, arguments->common);
  command->footer(R"(Examples:
  pagesweep scan capture -o result
  pagesweep scan capture -o result --dpi 400 --format tiff
  pagesweep scan capture -o plain --no-difference-vector   # the model alone: see what dents do
  pagesweep scan --live --camera cam1=192.168.3.2 --camera cam2=192.168.3.3 \
                 --scanner line=192.168.3.4 --rig rig.json -o result
)");
  command->callback([arguments] { run(*arguments); });
}

}  // namespace pagesweep::cli
