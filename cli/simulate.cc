// SPDX-License-Identifier: Apache-2.0
// pagesweep simulate: a capture of a book that was never there, with its truth.
#include "pagesweep/sim/simulate.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "cli/command.h"
#include "cli/console_progress.h"
#include "cli/option_visitor.h"
#include "cli/output_folder.h"
#include "pagesweep/base/parallel.h"

namespace pagesweep::cli {
namespace {

struct Arguments {
  CommonOptions common;
  std::filesystem::path scene;
  std::filesystem::path output;
  sim::SimulateOptions options;
};

void answer(const Arguments& arguments, const sim::Simulation& simulation) {
  const Sequence& sequence = simulation.frames.front().sequence();
  print_answer(arguments.common,
               {{"capture", arguments.output.string()},
                {"cameras", simulation.frames.size()},
                {"width", sequence.width},
                {"height", sequence.height},
                {"frames", sequence.count},
                {"scan", {{"width", simulation.scan.width()}, {"height", simulation.scan.height()}}},
                {"pages", simulation.pages.size()}},
               fmt::format("{}: {} cameras of {} x {} px, {} frames each, scan of {} x {} px\n",
                           arguments.output.string(), simulation.frames.size(), sequence.width, sequence.height,
                           sequence.count, simulation.scan.width(), simulation.scan.height()));
}

void run(const Arguments& arguments) {
  const ThreadLimit limit(arguments.common.threads);
  ConsoleProgress progress(arguments.common.quiet);
  const sim::Scene scene = sim::read_scene(arguments.scene);
  OutputFolder output(arguments.output, "capture.json");
  const sim::Simulation simulation = sim::simulate(scene, arguments.options, progress);
  output.begin();
  sim::write_simulation(simulation, output.path(), progress);
  output.finish();
  progress.finish();
  answer(arguments, simulation);
}

}  // namespace

void add_simulate_command(CLI::App& app) {
  auto* command = app.add_subcommand("simulate", R"(Render a capture of a scene, with the truth of everything.

Reads a scene (a JSON file; see scenes/) and writes a capture folder as a scanner would, and in
its folder truth/ what the measurement should find: the true points, the flat pages as printed,
and where in the scan each spot of them is.
)");
  const auto arguments = std::make_shared<Arguments>();
  add_input(*command, "SCENE", arguments->scene, "scene file");
  add_output(*command, arguments->output, "where the capture goes");
  arguments->options.describe(OptionVisitor(*command, "Rendering"));
  add_common_options(*command, arguments->common);
  command->footer(R"(Examples:
  pagesweep simulate scenes/spread.json --preview -o capture     # small, within seconds
  pagesweep simulate scenes/spread.json -o capture               # as large as a real one
)");
  command->callback([arguments] { run(*arguments); });
}

}  // namespace pagesweep::cli
