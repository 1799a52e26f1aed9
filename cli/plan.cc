// SPDX-License-Identifier: Apache-2.0
// pagesweep plan: how accurate a rig will be, before it is built.
#include "pagesweep/planning/plan.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "cli/command.h"
#include "cli/console_progress.h"
#include "cli/option_visitor.h"
#include "cli/output_folder.h"
#include "pagesweep/base/error.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/io/rig_file.h"
#include "pagesweep/report/plan_report.h"

namespace pagesweep::cli {
namespace {

struct Arguments {
  CommonOptions common;
  std::filesystem::path rig;
  std::filesystem::path output;  ///< empty: nothing is written
  std::string page = "A3";
  PlanRequest request;
};

/// The request of the command line, with the cameras and the light of the rig.
PlanRequest request_of(const Arguments& arguments) {
  PlanRequest request = arguments.request;
  const auto extent = extent_named(arguments.page);
  if (!extent)
    throw std::invalid_argument(
        fmt::format("--page: '{}' is neither A2 to A5 nor a size in mm like 420x297 or 420x297+10-20", arguments.page));
  request.table = *extent;
  const Rig rig = read_rig(arguments.rig);
  request.cameras = rig.cameras;
  if (request.cameras.size() > 2)
    throw bad_input(arguments.rig, "cameras", fmt::format("a plan is for one or two, found {}", rig.cameras.size()));
  if (rig.light)
    request.light = *rig.light;
  else if (request.mm_per_frame == 0)
    throw bad_input(arguments.rig, "light",
                    "the rig has none: tell with --mm-per-frame how fast the stripe moves along y, or add the light");
  return request;
}

void run(const Arguments& arguments) {
  const ThreadLimit limit(arguments.common.threads);
  const Plan plan = make_plan(request_of(arguments));
  std::string text = format_plan_text(plan);
  if (!arguments.output.empty()) {
    OutputFolder output(arguments.output, "plan.json");
    output.begin();
    write_plan(output.path(), plan, arguments.rig.string(), "pagesweep " PAGESWEEP_VERSION);
    output.finish();
    text += "Maps: " + (output.path() / "plan.html").string() + "\n";
  }
  print_answer(arguments.common, nlohmann::ordered_json::parse(format_plan_json(plan, false)), text);
}

void add_table_options(CLI::App& command, Arguments& arguments) {
  const std::string group = "Table";
  command.add_option("--page", arguments.page)
      ->group(group)
      ->option_text("<size>")
      ->description(
          "what is to be measured: A2 to A5 lying on the long side, or its size along x and y in mm like "
          "420x297, 420x297+10-20 with its middle elsewhere than at x = 0, y = 0 [A3]");
  command.add_option("--height-mm", arguments.request.heights_mm)
      ->group(group)
      ->option_text("<mm>,...")
      ->delimiter(',')
      ->description("heights of the paper above the table [0,30,60]");
  OptionVisitor visit(command, group);
  visit("grid-mm", arguments.request.grid_mm, "mm", "from one place to the next");
}

}  // namespace

void add_plan_command(CLI::App& app) {
  auto* command = app.add_subcommand("plan", R"(Predict how accurate a rig will be, before it is built.

Reads a rig (the rig.json of a capture, or one that was written by hand) and computes the least
standard deviation that light, sensor and geometry allow: of the time values, the matches and
the points of level paper over the table, for two cameras, for two cameras with a known sheet
of light, and for one with it. Then it changes one thing after the other and says what that
would give. With -o it also writes

  plan.html   maps of the height error over the table
  plan.json   the same for programs
)");
  const auto arguments = std::make_shared<Arguments>();
  add_input(*command, "RIG", arguments->rig, "rig file");
  command->add_option("-o,--output", arguments->output, "where maps go; without it nothing is written")
      ->option_text("<folder>");
  OptionVisitor recording(*command, "Recording");
  arguments->request.recording.describe(recording);
  recording("mm-per-frame", arguments->request.mm_per_frame, "mm",
            "how far the stripe moves on the table in a frame; 0: as the rig's light does");
  add_table_options(*command, *arguments);
  add_common_options(*command, arguments->common);
  command->footer(R"(Examples:
  pagesweep plan capture/rig.json
  pagesweep plan rig.json --stripe-mm 6 --mm-per-frame 1.2 --bits 12 -o plan
  pagesweep plan rig.json --page 600x400 --height-mm 0,50,100 --json
)");
  command->callback([arguments] { run(*arguments); });
}

}  // namespace pagesweep::cli
