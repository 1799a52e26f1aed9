// SPDX-License-Identifier: Apache-2.0
// pagesweep check: whether a rig still describes the instrument.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "cli/capture_input.h"
#include "cli/command.h"
#include "cli/console_progress.h"
#include "cli/exit_code.h"
#include "cli/option_visitor.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/io/image_file.h"
#include "pagesweep/pipeline/check_capture.h"

namespace pagesweep::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct Arguments {
  CommonOptions common;
  fs::path rig;
  fs::path capture;
  fs::path picture;
  fs::path refined;  ///< empty: nothing is written
  double max_moved_mm = 0.1;
  DriftPriors priors;
};

Json json_of(const std::optional<Disagreement>& seen) {
  if (!seen) return nullptr;
  return {{"median", seen->median}, {"rms", seen->rms}, {"places", seen->places}};
}

std::string line_of(const std::string& what, const std::string& unit, const std::optional<Disagreement>& seen,
                    const std::string& why_not) {
  if (!seen) return fmt::format("  {:<46} not known: {}\n", what, why_not);
  return fmt::format("  {:<46} {:.3f} {} median, {:.3f} {} rms, {} places\n", what, seen->median, unit, seen->rms, unit,
                     seen->places);
}

Json json_of(const RigCheck& check, bool holds, const Arguments& arguments) {
  Json cameras = Json::array();
  for (const CameraDrift& drift : check.correction.cameras)
    cameras.push_back({{"camera", drift.camera.name},
                       {"turn_deg", drift.turn_deg},
                       {"turn_sigma_deg", drift.turn_sigma_deg},
                       {"shift_mm", drift.shift_mm},
                       {"shift_sigma_mm", drift.shift_sigma_mm}});
  return {{"holds", holds},
          {"moved_rms_mm", check.correction.moved_rms_mm},
          {"max_moved_mm", arguments.max_moved_mm},
          {"across_epipolar_px", json_of(std::optional(check.across_px))},
          {"scan_mm", json_of(check.scan_mm)},
          {"light_mm", json_of(check.light_mm)},
          {"cameras", cameras},
          {"tie_points", check.correction.used},
          {"misfit", check.correction.misfit},
          {"refined", arguments.refined.empty() ? Json(nullptr) : Json(arguments.refined.string())}};
}

std::string text_of(const RigCheck& check, bool holds, const Arguments& arguments) {
  const PoseCorrection& correction = check.correction;
  std::string text =
      fmt::format("{}: with corrected poses its points would move by {:.3f} mm (rms; limit {:g} mm)\n",
                  holds ? "The rig holds" : "The rig does not hold", correction.moved_rms_mm, arguments.max_moved_mm);
  text += line_of("print beside the cameras' epipolar curves", "px", check.across_px, "");
  text +=
      line_of("print in the scan, from where the rig has it", "mm", check.scan_mm, "no scan, or no scanner in the rig");
  text += line_of("points beside the light's plane of their time", "mm", check.light_mm, "no light in the rig");
  for (const CameraDrift& drift : correction.cameras)
    text += fmt::format("  {} has turned by {:.4f} degrees (+- {:.4f}) and moved by {:.3f} mm (+- {:.3f})\n",
                        drift.camera.name, drift.turn_deg, drift.turn_sigma_deg, drift.shift_mm, drift.shift_sigma_mm);
  if (!arguments.refined.empty())
    text += fmt::format("Corrected rig: {}\n", arguments.refined.string());
  else if (!holds)
    text += "Calibrate again, or correct the poses with --refine FILE.\n";
  return text;
}

Rig corrected(Rig rig, const PoseCorrection& correction) {
  for (Camera& camera : rig.cameras)
    for (const CameraDrift& drift : correction.cameras)
      if (drift.camera.name == camera.name) camera = drift.camera;
  return rig;
}

void run(const Arguments& arguments) {
  const ThreadLimit limit(arguments.common.threads);
  ConsoleProgress progress(arguments.common.quiet);
  const CaptureInput input{.capture = arguments.capture, .rig = arguments.rig, .picture = arguments.picture};
  const OpenedCapture opened = open(input);
  std::optional<Picture> scan;
  if (!arguments.picture.empty() || opened.capture.scan_path()) scan = read_picture(input.picture_of(opened.capture));
  const RigCheck check = check_capture(*opened.frames, opened.rig, scan ? &*scan : nullptr, arguments.priors, progress);
  progress.finish();
  const bool holds = check.correction.moved_rms_mm <= arguments.max_moved_mm;
  if (!arguments.refined.empty()) write_rig(arguments.refined, corrected(opened.rig, check.correction));
  print_answer(arguments.common, json_of(check, holds, arguments), text_of(check, holds, arguments));
  if (!holds && arguments.refined.empty()) throw LimitExceeded{};
}

}  // namespace

void add_check_command(CLI::App& app) {
  auto* command = app.add_subcommand("check", R"(Say whether a rig still holds, from an ordinary scan.

Print is found again in both cameras and in the scan. How far it lies from where the rig has it,
and how well the points agree with the light's plane, tells whether a camera has moved since the
calibration. A page with text is enough. Ends with exit code 7 if the rig does not hold.

With --refine the poses of the cameras are corrected; lenses, scanner and light stay what they
were. A capture without scan and a rig without light leave the scale to the old poses.
)");
  const auto arguments = std::make_shared<Arguments>();
  add_input(*command, "RIG", arguments->rig, "rig.json that is in doubt");
  add_input(*command, "CAPTURE", arguments->capture, "folder with capture.json, or that file");
  command->add_option("--picture", arguments->picture, "the scanner's picture, in place of the capture's")
      ->option_text("<file>");
  command->add_option("--refine", arguments->refined, "write the rig with corrected poses to this file")
      ->option_text("<file>");
  command->add_option("--max-moved", arguments->max_moved_mm, "a rig whose points would move farther does not hold")
      ->option_text("<mm> [0.1]");
  arguments->priors.describe(OptionVisitor(*command, "What may have changed"));
  add_common_options(*command, arguments->common);
  command->footer(R"(Examples:
  pagesweep check rig.json capture
  pagesweep check rig.json capture --refine corrected.json
)");
  command->callback([arguments] { run(*arguments); });
}

}  // namespace pagesweep::cli
