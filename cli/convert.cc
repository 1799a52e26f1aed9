// SPDX-License-Identifier: Apache-2.0
// pagesweep convert: the same capture, its frames stored in another way.
#include "pagesweep/io/convert_capture.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "cli/capture_input.h"
#include "cli/command.h"
#include "cli/console_progress.h"
#include "cli/option_visitor.h"
#include "cli/output_folder.h"
#include "pagesweep/base/parallel.h"

namespace pagesweep::cli {
namespace {

struct Arguments {
  CommonOptions common;
  std::filesystem::path capture;
  std::filesystem::path output;
  ConvertOptions options;
};

void answer(const Arguments& arguments, const Capture& copy) {
  const std::string folder = arguments.output.string();
  const std::string format(name_of(arguments.options.format));
  print_answer(arguments.common,
               {{"capture", folder},
                {"format", format},
                {"cameras", copy.sequences.size()},
                {"frames", copy.sequences.front().count}},
               fmt::format("{}: {} cameras, {} frame instants, format {}\n", folder, copy.sequences.size(),
                           copy.sequences.front().count, format));
}

void run(const Arguments& arguments) {
  const ThreadLimit limit(arguments.common.threads);
  ConsoleProgress progress(arguments.common.quiet);
  const OpenedCapture opened = open({.capture = arguments.capture, .rig = {}, .picture = {}});
  OutputFolder output(arguments.output, "capture.json");
  const Capture copy = convert_capture(opened.capture, *opened.frames, output.path(), arguments.options, progress);
  output.finish();
  progress.finish();
  answer(arguments, copy);
}

}  // namespace

void add_convert_command(CLI::App& app) {
  auto* command = app.add_subcommand("convert", R"(Copy a capture, with its frames stored in another way.

Nothing is lost unless --drop or --lose say so: gray values, dropped frames, exposures, times and
notes stay what they are; the rig, the scan and the folder truth/ are copied as they are. A
recording is one file a camera, larger than PNGs and read many times faster. The output folder has
to be new or empty.
)");
  const auto arguments = std::make_shared<Arguments>();
  add_input(*command, "CAPTURE", arguments->capture, "folder with capture.json, or that file");
  add_output(*command, arguments->output, "where the copy goes");
  arguments->options.describe(OptionVisitor(*command, "Storing"));
  add_common_options(*command, arguments->common);
  command->footer(R"(Examples:
  pagesweep convert capture -o fast                      # to be measured again and again
  pagesweep convert fast -o archive --format png         # to be kept
  pagesweep convert capture -o poor --drop 0.1           # what one frame in ten lost would cost
)");
  command->callback([arguments] { run(*arguments); });
}

}  // namespace pagesweep::cli
