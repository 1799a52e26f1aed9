// SPDX-License-Identifier: Apache-2.0
// pagesweep fake-rig: a capture as cameras on the network.
#include "pagesweep/live/fake_rig.h"

#include <fmt/format.h>

#include <chrono>
#include <nlohmann/json.hpp>
#include <thread>

#include "cli/capture_input.h"
#include "cli/command.h"
#include "cli/console_progress.h"
#include "cli/interrupt.h"
#include "cli/option_visitor.h"
#include "pagesweep/io/image_file.h"

namespace pagesweep::cli {
namespace {

struct Arguments {
  CommonOptions common;
  std::filesystem::path capture;
  std::filesystem::path devices;
  bool no_line = false;
  FakeRigOptions options;
};

/// Until a signal comes.
void serve(const FakeRig& rig, const CommonOptions& common) {
  try {
    while (true) {
      throw_if_interrupted();
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
  } catch (const Interrupted&) {
    nlohmann::ordered_json json = {{"sweeps", rig.sweeps()}};
    std::string text = fmt::format("{} sweeps", rig.sweeps());
    for (const FakeCameraCounts& camera : rig.counts()) {
      json["sent"][camera.name] = camera.sent;
      text += fmt::format("; {} sent {} frames", camera.name, camera.sent);
    }
    print_answer(common, json, text + "\n");
  }
}

void run(const Arguments& arguments) {
  ConsoleProgress progress(arguments.common.quiet);
  const OpenedCapture opened = open({.capture = arguments.capture, .rig = {}, .picture = {}});
  std::vector<Frames> frames = read_all(*opened.frames, progress);
  std::optional<Picture> scan;
  if (opened.capture.scan && !arguments.no_line) scan = read_picture(*opened.capture.scan_path());
  const FakeRig rig(std::move(frames), std::move(scan), arguments.options);
  if (!arguments.devices.empty()) write_devices(arguments.devices, rig.devices());
  progress.finish();
  if (!arguments.common.quiet)
    for (const FakeCameraCounts& camera : rig.counts())
      fmt::print(stderr, "{} is at {}, serial {}\n", camera.name, camera.address, camera.serial);
  serve(rig, arguments.common);
}

}  // namespace

void add_fake_rig_command(CLI::App& app) {
  auto* command = app.add_subcommand("fake-rig", R"(Serve a capture as cameras on the network.

The capture's cameras become GigE Vision cameras at 127.0.0.1, 127.0.0.2, ..., and its scan a line
camera at the next address. They are wired to one trigger line, "Line0", and begin a sweep whenever
all cameras have been started. With it everything can be tried without hardware. Ends when it is
interrupted, and says then how many frames it sent.

The addresses must be this computer's: scripts/own-network runs a shell in which they are.
)");
  const auto arguments = std::make_shared<Arguments>();
  add_input(*command, "CAPTURE", arguments->capture, "folder with capture.json, or that file");
  command->add_option("--devices", arguments->devices, "write settings that suit these cameras there")
      ->option_text("<file>");
  command->add_flag("--no-line", arguments->no_line, "without the line camera");
  arguments->options.describe(OptionVisitor(*command, "Cameras"));
  add_common_options(*command, arguments->common);
  command->footer(R"(Examples:
  pagesweep fake-rig capture --devices devices.json &
  pagesweep fake-rig capture --packet-loss 0.001 &            # one packet in a thousand gets lost
  pagesweep fake-rig capture --dead cam2 --dead-frame 90 &    # what if a cable breaks?
)");
  command->callback([arguments] { run(*arguments); });
}

}  // namespace pagesweep::cli
