// SPDX-License-Identifier: Apache-2.0
// pagesweep calibrate: a rig from pictures of a board.
#include "pagesweep/calibration/calibrate.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "cli/board_pictures.h"
#include "cli/board_sweeps.h"
#include "cli/command.h"
#include "cli/console_progress.h"
#include "cli/option_visitor.h"
#include "cli/output_folder.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/calibration/accuracy.h"
#include "pagesweep/io/board_file.h"
#include "pagesweep/io/rig_file.h"
#include "pagesweep/report/calibration_report.h"

namespace pagesweep::cli {
namespace {

constexpr std::array<double, 3> heights_mm{0, 30, 60};  ///< for which accuracy is predicted: an open book's

struct Arguments {
  CommonOptions common;
  std::filesystem::path board, output;
  std::filesystem::path report;  ///< empty: beside the rig
  std::vector<std::string> cameras;
  std::string scanner;
  std::vector<std::filesystem::path> sweeps;
  DetectionOptions detection;
  CalibrationOptions calibration;
};

CalibrationInput read_pictures(const Arguments& arguments, Progress& progress) {
  const Board board = read_board(arguments.board);
  std::vector<PictureList> cameras;
  for (const std::string& text : arguments.cameras) {
    cameras.push_back(list_pictures(text, ""));
    const std::string& name = cameras.back().sensor;
    if (name == "scanner" || std::ranges::count(cameras, name, &PictureList::sensor) > 1)
      throw std::invalid_argument(fmt::format("--camera: another camera, or the scanner, is called '{}'", name));
  }
  std::optional<PictureList> scanner;
  if (!arguments.scanner.empty()) scanner = list_pictures(arguments.scanner, "scanner");
  return find_boards(board, cameras, scanner ? &*scanner : nullptr, arguments.detection, progress);
}

/// rig.json gets its report in rig-report/, another name likewise.
std::filesystem::path report_folder(const Arguments& arguments) {
  if (!arguments.report.empty()) return arguments.report;
  return arguments.output.parent_path() / (arguments.output.stem().string() + "-report");
}

/// What sweeps tell beside the corners: light and sensors.
std::string learn_from_sweeps(const CalibrationInput& input, const std::vector<WatchedSweep>& sweeps,
                              Calibration& calibration) {
  if (sweeps.empty()) return {};
  const LightFit light = light_of(sweeps, calibration);
  calibration.rig.light = light.light;
  describe_sensors(input, sweeps, calibration.rig);
  std::string text = fmt::format("Light: a plane that {}, {:.3f} mm rms at {} places\n",
                                 light.turns ? "turns evenly" : "moves evenly", light.rms_mm, light.used);
  if (light.tilt_sigma > 0.02)
    text += "  Its tilt is not known well: let it sweep over the board once more, lifted or tilted.\n";
  for (const Camera& camera : calibration.rig.cameras)
    if (camera.sensor)
      text += fmt::format("{}: {:.3f} gray values an electron, read noise {:.2f} gray values, blur {:.2f} px\n",
                          camera.name, camera.sensor->gain, camera.sensor->read_noise, camera.sensor->psf_sigma_px);
  return text;
}

void run(const Arguments& arguments) {
  if (arguments.cameras.empty() && arguments.sweeps.empty())
    throw std::invalid_argument("--camera or --sweep: there is nothing to calibrate from");
  const ThreadLimit limit(arguments.common.threads);
  ConsoleProgress progress(arguments.common.quiet);
  OutputFolder output(report_folder(arguments), "report.json");
  CalibrationInput input = read_pictures(arguments, progress);
  const auto sweeps = add_sweeps(arguments.sweeps, arguments.detection, input, progress);
  Calibration calibration = calibrate(input, arguments.calibration, progress);
  const std::string learned = learn_from_sweeps(input, sweeps, calibration);
  progress.begin("predicting the accuracy");
  CalibrationReport report = judge_calibration(input, calibration, predict_accuracy(calibration, heights_mm));
  report.title = arguments.output.string();
  report.program = "pagesweep " PAGESWEEP_VERSION;
  add_options(report.options, "calibration", arguments.calibration);
  add_options(report.options, "detection", arguments.detection);
  output.begin();
  write_calibration_report(output.path(), report);
  write_rig(arguments.output, calibration.rig);
  output.finish();
  progress.finish();
  print_answer(
      arguments.common, nlohmann::ordered_json::parse(format_calibration_json(report)),
      format_calibration_text(report) + learned + "Report: " + (output.path() / "report.html").string() + "\n");
}

void add_inputs(CLI::App& command, Arguments& arguments) {
  command.add_option("--board", arguments.board, "the board's definition, that `pagesweep board` wrote")
      ->required()
      ->option_text("<file>");
  command
      .add_option(
          "--camera", arguments.cameras,
          "a camera's name and its pictures, in quotes; once for each camera. Pictures with the same name belong "
          "together")
      ->option_text("<name>=<files>");
  command.add_option("--scanner", arguments.scanner, "the scanner's pictures of the same poses, in quotes")
      ->option_text("<files>");
  command
      .add_option(
          "--sweep", arguments.sweeps,
          "a capture of the light's sweep over the board; it gives pictures of all sensors, the light's motion, "
          "noise and blur")
      ->option_text("<capture> ...");
  command.add_option("-o,--output", arguments.output, "the rig to write")->required()->option_text("<file>");
  command.add_option("--report", arguments.report, "where the report goes; else into a folder beside the rig")
      ->option_text("<folder>");
}

}  // namespace

void add_calibrate_command(CLI::App& app) {
  auto* command = app.add_subcommand("calibrate", R"(Calibrate cameras and scanner from pictures of a board.

Finds the board in every picture, adjusts all cameras, the scanner and the poses of the board
at once, and writes the rig. Its frame has z = 0 on the table, where the board lies in the
first picture (--table-pose names another), z up to the cameras and y along the sweep. The
report says how good the rig is, and which pictures would make it better:

  rig-report/report.html   in words, figures and plots
  rig-report/report.json   the same for programs, with the covariance of every parameter
)");
  const auto arguments = std::make_shared<Arguments>();
  add_inputs(*command, *arguments);
  arguments->calibration.describe(OptionVisitor(*command, "Calibration"));
  arguments->detection.describe(OptionVisitor(*command, "Finding the board"));
  add_common_options(*command, arguments->common);
  command->footer(R"(Examples:
  pagesweep calibrate --board board.json --camera 'cam1=left/*.png' --camera 'cam2=right/*.png' \
                      -o rig.json
  pagesweep calibrate --board board.json --camera 'cam1=cam1/*.png' --camera 'cam2=cam2/*.png' \
                      --scanner 'scans/*.tif' --cross-validate -o rig.json
  pagesweep calibrate --board board.json --sweep sweeps/* -o rig.json
)");
  command->callback([arguments] { run(*arguments); });
}

}  // namespace pagesweep::cli
