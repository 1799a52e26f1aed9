// SPDX-License-Identifier: Apache-2.0
// pagesweep calibrate: a rig from pictures of a board.
#include "pagesweep/calibration/calibrate.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "cli/board_pictures.h"
#include "cli/command.h"
#include "cli/console_progress.h"
#include "cli/option_visitor.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/io/board_file.h"
#include "pagesweep/io/rig_file.h"

namespace pagesweep::cli {
namespace {

struct Arguments {
  CommonOptions common;
  std::filesystem::path board, output;
  std::vector<std::string> cameras;
  std::string scanner;
  DetectionOptions detection;
  CalibrationOptions calibration;
};

CalibrationInput read_pictures(const Arguments& arguments, Progress& progress) {
  const Board board = read_board(arguments.board);
  std::vector<PictureList> cameras;
  for (const std::string& text : arguments.cameras) cameras.push_back(list_pictures(text, ""));
  std::optional<PictureList> scanner;
  if (!arguments.scanner.empty()) scanner = list_pictures(arguments.scanner, "scanner");
  return find_boards(board, cameras, scanner ? &*scanner : nullptr, arguments.detection, progress);
}

void run(const Arguments& arguments) {
  const ThreadLimit limit(arguments.common.threads);
  ConsoleProgress progress(arguments.common.quiet);
  const CalibrationInput input = read_pictures(arguments, progress);
  const Calibration calibration = calibrate(input, arguments.calibration, progress);
  write_rig(arguments.output, calibration.rig);
  progress.finish();
}

}  // namespace

void add_calibrate_command(CLI::App& app) {
  auto* command = app.add_subcommand("calibrate", R"(Calibrate cameras and scanner from pictures of a board.
)");
  const auto arguments = std::make_shared<Arguments>();
  command->add_option("--board", arguments->board, "the board's definition")->required()->option_text("<file>");
  command->add_option("--camera", arguments->cameras, "a camera's name and its pictures")
      ->required()
      ->option_text("<name>=<files>");
  command->add_option("--scanner", arguments->scanner, "the scanner's pictures")->option_text("<files>");
  command->add_option("-o,--output", arguments->output, "the rig to write")->required()->option_text("<file>");
  arguments->calibration.describe(OptionVisitor(*command, "Calibration"));
  arguments->detection.describe(OptionVisitor(*command, "Finding the board"));
  add_common_options(*command, arguments->common);
  command->callback([arguments] { run(*arguments); });
}

}  // namespace pagesweep::cli
