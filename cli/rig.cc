// SPDX-License-Identifier: Apache-2.0
// pagesweep rig: calibrated cameras to and from the files of other programs.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <nlohmann/json.hpp>
#include <stdexcept>

#include "cli/command.h"
#include "cli/describe.h"
#include "cli/option_visitor.h"
#include "pagesweep/base/error.h"
#include "pagesweep/io/image_file.h"
#include "pagesweep/io/rig_conversion.h"
#include "pagesweep/io/rig_file.h"

namespace pagesweep::cli {
namespace {

namespace fs = std::filesystem;

/// What is told about the light beside the cameras.
struct LightArguments {
  std::string white;
  double white_height_mm = 0;
  double lamp_height_mm = 0, lamp_length_mm = 0, lamp_center_mm = 0;

  template <class Visitor>
  void describe(Visitor&& visit) {
    visit("white", white, "", "scan of a blank white sheet that covers all of it: the white reference");
    visit("white-height", white_height_mm, "mm", "height of that sheet above the table");
    visit("lamp-height", lamp_height_mm, "mm", "height of the lamp's bar above the table; 0: not told");
    visit("lamp-length", lamp_length_mm, "mm", "length of the bar");
    visit("lamp-center", lamp_center_mm, "mm", "middle of the bar along the stripe");
  }
  bool is_told() const { return !white.empty() || lamp_height_mm != 0; }
};

struct Arguments {
  CommonOptions common;
  std::vector<fs::path> inputs;
  fs::path output;
  RigConversionOptions options;
  LightArguments light;
};

bool is_ours(const fs::path& file) { return file.extension() == ".json"; }

/// What a reader of the answer has to know, one line each.
void add_notes(Description& answer, const std::vector<std::string>& notes) {
  for (const std::string& note : notes) answer.lines.push_back("  " + note);
  answer.json["notes"] = notes;
}

void add_light(const LightArguments& light, Rig& rig) {
  if (light.lamp_height_mm != 0) {
    if (!(light.lamp_height_mm > 0 && light.lamp_length_mm > 0))
      throw std::invalid_argument("--lamp-height and --lamp-length have to be above 0, and told together");
    rig.lamp = LampBar{light.lamp_height_mm, light.lamp_length_mm, light.lamp_center_mm};
  }
  if (light.white.empty()) return;
  const Picture sheet = read_picture(light.white);
  if (rig.scanner && (sheet.width() != rig.scanner->width() || sheet.height() != rig.scanner->height()))
    throw bad_input(light.white, "",
                    fmt::format("it has {} x {} pixels but the rig's scanner {} x {}", sheet.width(), sheet.height(),
                                rig.scanner->width(), rig.scanner->height()));
  try {
    rig.white = measure_white(sheet, light.white_height_mm);
  } catch (const Error& error) {
    throw bad_input(light.white, "", error.what());
  }
}

Rig read_any_rig(const Arguments& arguments) {
  if (arguments.inputs.size() == 1 && is_ours(arguments.inputs.front()) && arguments.light.is_told())
    return read_rig(arguments.inputs.front());
  return import_rig(arguments.inputs, arguments.options);
}

Description import(const Arguments& arguments) {
  Rig rig = read_any_rig(arguments);
  add_light(arguments.light, rig);
  write_rig(arguments.output, rig);
  Description answer = describe_rig(rig);
  answer.lines.front() = fmt::format("{}: {}", arguments.output.string(), answer.lines.front());
  std::vector<std::string> notes;
  const Rigid3& first = rig.cameras.front().cam_from_rig;
  if (first.rotation.isIdentity(0) && first.translation.isZero(0))
    notes.push_back(
        fmt::format("the rig frame is that of camera {}: z is not the height above a table", rig.cameras.front().name));
  add_notes(answer, notes);
  return answer;
}

Description export_to(const Arguments& arguments) {
  if (arguments.inputs.size() != 1 || !is_ours(arguments.inputs.front()))
    throw std::invalid_argument("one side has to be a rig of pagesweep: either INPUT or --output ends in .json");
  const Rig rig = read_rig(arguments.inputs.front());
  const RigFormat format = export_rig(arguments.output, rig, arguments.options);
  Description answer;
  std::vector<std::string> names;
  names.reserve(rig.cameras.size());
  for (const Camera& camera : rig.cameras) names.push_back(camera.name);
  answer.lines.push_back(
      fmt::format("{}: {} in the format {}", arguments.output.string(), fmt::join(names, ", "), name_of(format)));
  answer.json = {{"kind", "export"}, {"format", name_of(format)}, {"cameras", names}};
  std::vector<std::string> notes;
  if (const std::string lost = lost_by_export(rig); !lost.empty())
    notes.push_back(fmt::format("left out, as {} has no place for it: {}", name_of(format), lost));
  add_notes(answer, notes);
  return answer;
}

void run(const Arguments& arguments) {
  const Description answer = is_ours(arguments.output) ? import(arguments) : export_to(arguments);
  print_answer(arguments.common, answer.json, answer.text());
}

}  // namespace

void add_rig_command(CLI::App& app) {
  auto* command = app.add_subcommand("rig", R"(Convert a rig from or to a file of another program.

From the files of OpenCV (YAML of its calibration or stereo sample), COLMAP (cameras.txt and
images.txt) or Kalibr (camchain.yaml) into a rig.json, if OUTPUT ends in .json; else the other way.
Cameras and their places are converted; scanner, light and sensors exist in a rig.json only.

With --white or --lamp-height it adds to a rig.json what is known of the light, for pages that are
to be evened out.
)");
  const auto arguments = std::make_shared<Arguments>();
  command->add_option("INPUT", arguments->inputs, "a rig.json, or the other program's files or folder")->required();
  command
      ->add_option("-o,--output", arguments->output,
                   "what is written: a rig.json, or the other program's file or folder")
      ->required()
      ->option_text("<file or folder>");
  arguments->options.describe(OptionVisitor(*command, "Conversion"));
  arguments->light.describe(OptionVisitor(*command, "Light"));
  add_common_options(*command, arguments->common);
  command->footer(R"(Examples:
  pagesweep rig intrinsics.yml extrinsics.yml --image-size 1024x768 -o rig.json
  pagesweep rig sparse/0 --unit 123.4 -o rig.json        # COLMAP, whose unit is 123.4 mm long
  pagesweep rig rig.json -o camchain.yaml                # for Kalibr
  pagesweep rig rig.json --format colmap -o model
  pagesweep rig rig.json --white blank.tif --lamp-height 600 --lamp-length 560 -o rig.json
)");
  command->callback([arguments] { run(*arguments); });
}

}  // namespace pagesweep::cli
