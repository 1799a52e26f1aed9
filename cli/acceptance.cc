// SPDX-License-Identifier: Apache-2.0
// pagesweep acceptance: the instrument against a calibrated artefact.
#include "pagesweep/acceptance/acceptance.h"

#include <nlohmann/json.hpp>

#include "cli/capture_input.h"
#include "cli/command.h"
#include "cli/console_progress.h"
#include "cli/exit_code.h"
#include "cli/option_visitor.h"
#include "cli/output_folder.h"
#include "cli/result_output.h"
#include "pagesweep/base/error.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/io/artefact_file.h"
#include "pagesweep/io/result_files.h"

namespace pagesweep::cli {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  CommonOptions common;
  std::vector<fs::path> inputs;
  fs::path artefact;
  fs::path rig;  ///< empty: those that the captures name
  fs::path output;
  AcceptanceOptions acceptance;
  AcceptanceLimits limits;
  ScanOptions measuring;
};

bool is_capture(const fs::path& input) {
  return input.filename() == "capture.json" || fs::exists(input / "capture.json");
}

/// Name of a pose for people: that of its folder.
std::string name_of_pose(const fs::path& folder) {
  std::error_code failure;
  const fs::path whole = fs::weakly_canonical(folder, failure);
  return (whole.has_filename() ? whole : whole.parent_path()).filename().string();
}

ArtefactPose pose_of_capture(const fs::path& input, const Arguments& arguments, Progress& progress) {
  const OpenedCapture opened = open({.capture = input, .rig = arguments.rig, .picture = {}});
  Measurement measurement = reconstruct(*opened.frames, opened.rig, arguments.measuring, progress);
  return {title_of(opened.capture), std::move(measurement.cameras), std::move(measurement.points)};
}

ArtefactPose pose_of_result(const fs::path& input, const Arguments& arguments) {
  if (!fs::is_directory(input)) throw pagesweep::cannot_read(input, "there is no such folder");
  if (arguments.rig.empty())
    throw pagesweep::bad_input(input, "", "a folder of results does not know its cameras: give their rig with --rig");
  ArtefactPose pose{name_of_pose(input), {}, {}};
  for (const Camera& camera : read_rig(arguments.rig).cameras) {
    auto points = read_point_map(CameraFiles(input, camera.name), camera);
    if (!points) continue;
    pose.cameras.push_back(camera);
    pose.points.push_back(std::move(*points));
  }
  if (pose.cameras.empty())
    throw pagesweep::bad_input(
        input, "", "holds neither capture.json (a capture) nor the points of any camera of the rig (a result)");
  return pose;
}

PoseResult measure_pose(const fs::path& input, const Artefact& artefact, const Arguments& arguments,
                        Progress& progress) {
  const ArtefactPose pose =
      is_capture(input) ? pose_of_capture(input, arguments, progress) : pose_of_result(input, arguments);
  progress.begin("finding the artefact in " + pose.name);
  return measure_artefact(pose, artefact, arguments.acceptance);
}

AcceptanceReport report_of(const Arguments& arguments) {
  AcceptanceReport report{"pagesweep " PAGESWEEP_VERSION, {}};
  add_options(report.options, "acceptance", arguments.acceptance);
  add_options(report.options, "limits", arguments.limits);
  if (std::any_of(arguments.inputs.begin(), arguments.inputs.end(), is_capture))
    add_measuring_options(report.options, arguments.measuring);
  return report;
}

void run(const Arguments& arguments) {
  const ThreadLimit limit(arguments.common.threads);
  ConsoleProgress progress(arguments.common.quiet);
  OutputFolder output(arguments.output, "acceptance.json");
  const Artefact artefact = read_artefact(arguments.artefact);
  std::vector<PoseResult> poses;
  for (const fs::path& input : arguments.inputs) poses.push_back(measure_pose(input, artefact, arguments, progress));
  const Acceptance acceptance = judge_acceptance(artefact, std::move(poses), arguments.limits);

  progress.begin("writing the report");
  const AcceptanceReport report = report_of(arguments);
  output.begin();
  write_acceptance(output.path(), acceptance, report);
  output.finish();
  progress.finish();
  print_answer(arguments.common, nlohmann::ordered_json::parse(format_acceptance_json(acceptance, report)),
               format_acceptance_table(acceptance) + "Report: " + (output.path() / "acceptance.html").string() + "\n");
  if (acceptance.verdict == AcceptanceVerdict::failed) throw LimitExceeded{};
}

}  // namespace

void add_acceptance_command(CLI::App& app) {
  auto* command =
      app.add_subcommand("acceptance", R"(Test the instrument against a calibrated artefact (VDI/VDE 2634 part 2).

Finds a flat plate and one or two spheres among the measured points of several poses, and
determines the flatness measurement error, the probing errors form and size and the sphere
spacing error. Writes acceptance.html, one page with maps of the deviations, and
acceptance.json. Ends with exit code 7 if a limit is exceeded.
)");
  const auto arguments = std::make_shared<Arguments>();
  command->add_option("POSE", arguments->inputs, "captures, or folders that scan or reconstruct wrote; one a pose")
      ->required()
      ->option_text("...");
  command->add_option("--artefact", arguments->artefact, "the artefact's calibrated values")
      ->required()
      ->option_text("<file>");
  command->add_option("--rig", arguments->rig, "the cameras; needed for folders of results")->option_text("<file>");
  add_output(*command, arguments->output, "where the report goes");
  arguments->acceptance.describe(OptionVisitor(*command, "Judging"));
  arguments->limits.describe(OptionVisitor(*command, "Limits"));
  arguments->measuring.describe_measurement(OptionVisitor(*command, "Measuring captures"));
  add_common_options(*command, arguments->common);
  command->footer(R"(Examples:
  pagesweep acceptance --artefact artefact.json pose1 pose2 pose3 pose4 -o acceptance
  pagesweep acceptance --artefact artefact.json capture --max-sphere-spacing 0.02 -o acceptance
  pagesweep acceptance --artefact artefact.json result1 result2 --rig rig.json -o acceptance
)");
  command->callback([arguments] { run(*arguments); });
}

}  // namespace pagesweep::cli
