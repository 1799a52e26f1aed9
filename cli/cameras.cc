// SPDX-License-Identifier: Apache-2.0
// pagesweep cameras: what is connected.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "cli/command.h"
#include "pagesweep/live/genicam_camera.h"

namespace pagesweep::cli {
namespace {

nlohmann::ordered_json to_json(const FoundCamera& camera) {
  nlohmann::ordered_json json = {{"id", camera.id},
                                 {"vendor", camera.vendor},
                                 {"model", camera.model},
                                 {"serial", camera.serial},
                                 {"address", camera.address},
                                 {"protocol", camera.protocol},
                                 {"sensor", {camera.sensor_width, camera.sensor_height}},
                                 {"pixel_formats", camera.pixel_formats}};
  if (!camera.problem.empty()) json["problem"] = camera.problem;
  return json;
}

void run(const CommonOptions& common) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  std::string text;
  for (const FoundCamera& camera : find_cameras()) {
    json.push_back(to_json(camera));
    text += fmt::format("{}\n  {} {}, serial {}, {} {}\n", camera.id, camera.vendor, camera.model, camera.serial,
                        camera.protocol, camera.address);
    if (camera.sensor_width > 0)
      text += fmt::format("  sensor {} x {} px, pixel formats {}\n", camera.sensor_width, camera.sensor_height,
                          fmt::join(camera.pixel_formats, ", "));
    if (!camera.problem.empty()) text += fmt::format("  cannot be used now: {}\n", camera.problem);
  }
  if (text.empty())
    text =
        "No camera answers. One that is connected does not if it has no power, if its network address is not in a\n"
        "network of this computer (ip address), if a firewall drops UDP port 3956 or, on USB, if this user may not\n"
        "open it (a udev rule is needed).\n";
  print_answer(common, {{"cameras", json}}, text);
}

}  // namespace

void add_cameras_command(CLI::App& app) {
  auto* command = app.add_subcommand("cameras", R"(List the cameras that are connected.

Cameras that speak GenICam, by GigE Vision or USB3 Vision: vendor, model, serial number, address,
sensor and pixel formats, and why one cannot be used. Their ids are what `pagesweep capture` and
`pagesweep scan --live` take; addresses do as well.
)");
  const auto common = std::make_shared<CommonOptions>();
  add_common_options(*command, *common);
  command->footer(R"(Examples:
  pagesweep cameras
  pagesweep cameras --json | jq '.cameras[].id'
)");
  command->callback([common] { run(*common); });
}

}  // namespace pagesweep::cli
