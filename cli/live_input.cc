// SPDX-License-Identifier: Apache-2.0
#include "cli/live_input.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "cli/option_visitor.h"
#include "pagesweep/base/error.h"

namespace pagesweep::cli {
namespace {

struct NamedDevice {
  std::string name, id;
};

NamedDevice split(const std::string& text, const std::string& option, const std::string& example) {
  const auto equals = text.find('=');
  if (equals == 0 || equals == std::string::npos || equals + 1 == text.size())
    throw CLI::ValidationError(option, fmt::format("expected something like {}, found \"{}\"", example, text));
  return {text.substr(0, equals), text.substr(equals + 1)};
}

Sequence sequence_of(const GenicamCamera& camera) {
  Sequence sequence{.camera = camera.name(), .width = camera.width(), .height = camera.height()};
  sequence.bit_depth = camera.bit_depth();
  sequence.black_level = camera.settings().dark_level;
  sequence.saturation = std::exp2(camera.bit_depth()) - 1;
  return sequence;
}

std::unique_ptr<GenicamCamera> open_camera(const NamedDevice& device, const Rig& rig, Devices& devices) {
  const Camera* camera = rig.find_camera(device.name);
  if (!camera)
    throw Error(ErrorKind::bad_input,
                fmt::format("the rig has no camera '{}': name each camera as the rig does", device.name));
  DeviceSettings settings = devices.of(device.name);
  if (settings.width == 0) settings.width = camera->width, settings.height = camera->height;
  if (settings.width != camera->width || settings.height != camera->height)
    throw Error(ErrorKind::bad_input,
                fmt::format("{}: the region of {} x {} pixels in devices.json is not what the rig was calibrated with, "
                            "{} x {}",
                            device.name, settings.width, settings.height, camera->width, camera->height));
  auto opened = std::make_unique<GenicamCamera>(device.name, device.id, settings);
  devices.cameras[device.name] = opened->settings();
  return opened;
}

std::unique_ptr<ScanPictureSource> open_scanner(const std::string& scanner, const Rig& rig, Devices& devices) {
  if (scanner.empty()) return nullptr;
  const NamedDevice device = split(scanner, "--scanner", "line=192.168.3.4 or folder=scans");
  if (!rig.scanner) throw Error(ErrorKind::bad_input, "the rig has no \"scanner\": no picture of it can be used");
  const int width = rig.scanner->width(), height = rig.scanner->height();
  if (device.name == "folder") return watch_folder(device.id, width, height);
  if (device.name != "line")
    throw CLI::ValidationError("--scanner", fmt::format("expected line=ID or folder=DIR, found \"{}\"", scanner));
  DeviceSettings settings = devices.of("line");
  settings.width = width, settings.height = settings.rows_a_buffer;
  auto camera = std::make_unique<GenicamCamera>("line", device.id, settings);
  devices.cameras["line"] = camera->settings();
  return take_lines(std::move(camera), height);
}

}  // namespace

void LiveInput::add_to(CLI::App& command) {
  command.add_option("--camera", cameras, "a camera: its name in the rig, and its id or address; once for each")
      ->option_text("<name=id>")
      ->group("Live");
  command
      .add_option(
          "--scanner", scanner,
          "where the scanner's picture comes from: line=ID, a GenICam line camera, or folder=DIR, into which the "
          "scanner's own software puts it")
      ->option_text("<line=id>")
      ->group("Live");
  command.add_option("--devices", devices, "devices.json: how the cameras are to be set")
      ->option_text("<file>")
      ->group("Live");
  options.describe(OptionVisitor(command, "Live"));
}

OpenedRig open(const LiveInput& input, const Rig& rig, LiveView& view) {
  if (input.cameras.empty())
    throw CLI::ValidationError("--camera",
                               "expected at least one, such as cam1=192.168.3.2; `pagesweep cameras` lists "
                               "what is connected");
  OpenedRig opened;
  if (!input.devices.empty()) opened.devices = read_devices(input.devices);
  std::vector<std::unique_ptr<GenicamCamera>> cameras;
  std::vector<Sequence> sequences;
  for (const std::string& text : input.cameras) {
    const NamedDevice device = split(text, "--camera", "cam1=192.168.3.2");
    if (std::ranges::find(sequences, device.name, &Sequence::camera) != sequences.end())
      throw CLI::ValidationError("--camera", fmt::format("{} is named twice", device.name));
    cameras.push_back(open_camera(device, rig, opened.devices));
    sequences.push_back(sequence_of(*cameras.back()));
  }
  opened.scanner = open_scanner(input.scanner, rig, opened.devices);
  opened.source = std::make_unique<LiveSource>(std::move(cameras), std::move(sequences), input.options,
                                               [&view](const LiveStatus& status) { view.show(status); });
  return opened;
}

}  // namespace pagesweep::cli
