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
#include "pagesweep/calibration/draw_board.h"
#include "pagesweep/io/board_file.h"
#include "pagesweep/sim/board_series.h"

namespace pagesweep::cli {
namespace {

struct Arguments {
  CommonOptions common;
  std::filesystem::path scene;
  std::filesystem::path output;
  sim::SimulateOptions options;
  std::filesystem::path board;  ///< empty: pages are rendered, not a board
  sim::BoardSeriesOptions series;
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

/// Pictures of a board instead of a sweep over pages.
void run_on_board(const Arguments& arguments) {
  const ThreadLimit limit(arguments.common.threads);
  ConsoleProgress progress(arguments.common.quiet);
  const sim::Scene scene = sim::read_scene(arguments.scene);
  const Board board = read_board(arguments.board);
  const BoardDrawing drawing = draw_board(board);
  OutputFolder output(arguments.output, "board.json");
  output.begin();
  sim::write_board_series(scene.rig, board, drawing, arguments.series, scene.sensor, arguments.options.seed,
                          output.path(), progress);
  output.finish();
  progress.finish();
  print_answer(arguments.common, {{"folder", arguments.output.string()}, {"poses", arguments.series.poses}},
               fmt::format("{}: a board in {} poses\n", arguments.output.string(), arguments.series.poses));
}

void run(const Arguments& arguments) {
  if (!arguments.board.empty()) return run_on_board(arguments);
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

With --board it renders pictures of a calibration board instead, in many poses, for the
scene's cameras and for a scanner: what `pagesweep calibrate` needs, with the true rig.
)");
  const auto arguments = std::make_shared<Arguments>();
  add_input(*command, "SCENE", arguments->scene, "scene file");
  add_output(*command, arguments->output, "where the capture goes");
  arguments->options.describe(OptionVisitor(*command, "Rendering"));
  command->add_option("--board", arguments->board, "the board's definition")->group("Boards")->option_text("<file>");
  arguments->series.describe(OptionVisitor(*command, "Boards"));
  add_common_options(*command, arguments->common);
  command->footer(R"(Examples:
  pagesweep simulate scenes/spread.json --preview -o capture     # small, within seconds
  pagesweep simulate scenes/spread.json -o capture               # as large as a real one
  pagesweep simulate scenes/flat.json --board board.json --poses 20 -o boards
)");
  command->callback([arguments] { run(*arguments); });
}

}  // namespace pagesweep::cli
