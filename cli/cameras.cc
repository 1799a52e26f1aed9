// SPDX-License-Identifier: Apache-2.0
// pagesweep cameras: what is connected.
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

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

struct Arguments {
  CommonOptions common;
  std::vector<std::string> expected;  ///< ids, addresses or serial numbers
};

void run(const Arguments& arguments) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array(), missing = nlohmann::ordered_json::array();
  std::string text;
  const std::vector<FoundCamera> cameras = find_cameras();
  for (const FoundCamera& camera : cameras) {
    json.push_back(to_json(camera));
    text += fmt::format("{}\n  {} {}, serial {}, {} {}\n", camera.id, camera.vendor, camera.model, camera.serial,
                        camera.protocol, camera.address);
    if (camera.sensor_width > 0)
      text += fmt::format("  sensor {} x {} px, pixel formats {}\n", camera.sensor_width, camera.sensor_height,
                          fmt::join(camera.pixel_formats, ", "));
    if (!camera.problem.empty()) text += fmt::format("  cannot be used now: {}\n", camera.problem);
  }
  for (const std::string& id : arguments.expected) {
    const auto is_it = [&](const FoundCamera& each) {
      return id == each.id || id == each.address || id == each.serial;
    };
    if (std::ranges::any_of(cameras, is_it)) continue;
    missing.push_back({{"id", id}, {"problem", why_missing(id)}});
    text += fmt::format("{}\n  does not answer: {}\n", id, why_missing(id));
  }
  if (text.empty())
    text =
        "No camera answers. One that is connected does not if it has no power, if its network address is not in a\n"
        "network of this computer (ip address), if a firewall drops UDP port 3956 or, on USB, if this user may not\n"
        "open it (a udev rule is needed). Name the address that it should have, to be told more.\n";
  print_answer(arguments.common, {{"cameras", json}, {"missing", missing}}, text);
}

}  // namespace

void add_cameras_command(CLI::App& app) {
  auto* command = app.add_subcommand("cameras", R"(List the cameras that are connected.

Cameras that speak GenICam, by GigE Vision or USB3 Vision: vendor, model, serial number, address,
sensor and pixel formats, and why one cannot be used. Their ids are what `pagesweep capture` and
`pagesweep scan --live` take; addresses do as well. Name a camera that should be there and is not,
to be told why.
)");
  const auto arguments = std::make_shared<Arguments>();
  command->add_option("CAMERA", arguments->expected, "cameras that should be there: addresses, ids or serial numbers");
  add_common_options(*command, arguments->common);
  command->footer(R"(Examples:
  pagesweep cameras
  pagesweep cameras 192.168.3.2 192.168.3.3       # why is one of them missing?
  pagesweep cameras --json | jq '.cameras[].id'
)");
  command->callback([arguments] { run(*arguments); });
}

}  // namespace pagesweep::cli
