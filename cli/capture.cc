// SPDX-License-Identifier: Apache-2.0
// pagesweep capture: a sweep from live cameras, recorded.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "cli/command.h"
#include "cli/exit_code.h"
#include "cli/live_input.h"
#include "cli/live_recording.h"
#include "pagesweep/io/rig_file.h"

namespace pagesweep::cli {
namespace {

struct Arguments {
  CommonOptions common;
  LiveInput input;
  std::filesystem::path rig;
  std::filesystem::path output;
};

nlohmann::ordered_json to_json(const LiveStatus& status) {
  nlohmann::ordered_json cameras = nlohmann::ordered_json::array();
  for (const auto& camera : status.cameras)
    cameras.push_back({{"name", camera.name},
                       {"received", camera.counts.received},
                       {"damaged", camera.counts.damaged},
                       {"lost", camera.counts.lost},
                       {"unpaired", camera.counts.unpaired},
                       {"late", camera.counts.late}});
  return cameras;
}

void run(const Arguments& arguments) {
  const Rig rig = read_rig(arguments.rig);
  LiveRecording recording(arguments.output);
  LiveView view(arguments.common.quiet);
  OpenedRig opened = open(arguments.input, rig, view);
  FrameSource& source = recording.begin(opened, true);
  while (source.next()) {
  }
  view.clear();
  const std::string why_ended = join_problems(opened.source->ended_early(), recording.trouble());
  if (!why_ended.empty()) view.warn(why_ended);
  LatePicture late_picture(opened.scanner.get());
  const Picture* picture = why_ended.empty() ? late_picture.get() : nullptr;
  const LiveStatus status = opened.source->status();
  const Capture capture =
      recording.finish(rig, picture, join_problems(opened.source->ended_early(), late_picture.problem()));
  view.finish(status);
  print_answer(arguments.common,
               {{"capture", recording.path().string()},
                {"frames", capture.sequences[0].count},
                {"cameras", to_json(status)},
                {"partial", !capture.notes.empty()},
                {"notes", capture.notes}},
               fmt::format("{}: {} cameras, {} triggers{}\n", recording.path().string(), capture.sequences.size(),
                           capture.sequences[0].count, capture.notes.empty() ? "" : "; " + capture.notes));
  if (!capture.notes.empty()) throw pagesweep::cannot_read(recording.path(), "the capture is " + capture.notes);
}

}  // namespace

void add_capture_command(CLI::App& app) {
  auto* command = app.add_subcommand("capture", R"(Record a sweep from live cameras.

Sets the cameras as devices.json says, waits for the stripe of light, records it and ends by itself
when it has left. Frames of the cameras are paired by trigger and time; what was lost is counted.
The folder is a capture that `pagesweep scan` reads, with the rig, the settings as the cameras took
them and, if there is a scanner, its picture. If a camera stops in the middle or the disk is full,
what was recorded until then is kept, capture.json says why it is partial, and the exit status is 4.
)");
  const auto arguments = std::make_shared<Arguments>();
  arguments->input.add_to(*command);
  command->add_option("--rig", arguments->rig, "the rig whose cameras these are")->required()->option_text("<file>");
  add_output(*command, arguments->output, "where the capture goes");
  add_common_options(*command, arguments->common);
  command->footer(R"(Examples:
  pagesweep capture --camera cam1=192.168.3.2 --camera cam2=192.168.3.3 --rig rig.json -o sweep
  pagesweep capture --camera cam1=127.0.0.1 --camera cam2=127.0.0.2 --scanner line=127.0.0.3 \
                    --devices devices.json --rig rig.json -o sweep     # of `pagesweep fake-rig`
)");
  command->callback([arguments] { run(*arguments); });
}

}  // namespace pagesweep::cli
