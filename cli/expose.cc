// SPDX-License-Identifier: Apache-2.0
// pagesweep expose: how well a sweep was exposed, and what would be better.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "cli/capture_input.h"
#include "cli/command.h"
#include "cli/console_progress.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/timing/advise_exposure.h"
#include "pagesweep/timing/time_stream.h"

namespace pagesweep::cli {
namespace {

struct Arguments {
  CommonOptions common;
  CaptureInput input;
};

nlohmann::ordered_json to_json(const ExposureAdvice& advice, const std::string& text) {
  return {{"clipped_share", advice.clipped_share},
          {"dark_share", advice.dark_share},
          {"top", advice.top},
          {"light_factor", advice.light_factor},
          {"stripe_frames", advice.stripe_frames},
          {"speed_factor", advice.speed_factor},
          {"good", advice.is_good},
          {"advice", text}};
}

void run(const Arguments& arguments) {
  const ThreadLimit limit(arguments.common.threads);
  ConsoleProgress progress(arguments.common.quiet);
  const OpenedCapture opened = open(arguments.input);
  FrameSource& frames = *opened.frames;
  TimeStream times(frames.sequences());
  progress.begin("following the stripe");
  while (auto set = frames.next()) {
    progress.advance((set->index + 1.0) / frames.sequences()[0].count);
    times.add(*std::move(set));
  }
  const Timing timing = times.finish(progress);
  progress.finish();
  nlohmann::ordered_json json = nlohmann::ordered_json::object();
  std::string text;
  for (std::size_t c = 0; c < timing.maps.size(); ++c) {
    const Sequence& sequence = frames.sequences()[c];
    const auto& exposures = opened.capture.sequences[c].exposure_ms;
    const ExposureAdvice advice = advise_exposure(sequence, timing.maps[c], times.clipped_frames(c), timing.profile);
    const std::string words =
        describe(advice, exposures.size() == 1 ? exposures[0] : 0, 1e-6 * opened.capture.frame_interval_ns);
    json[sequence.camera] = to_json(advice, words);
    text += fmt::format("{}: {}\n", sequence.camera, words);
  }
  print_answer(arguments.common, json, text);
}

}  // namespace

void add_expose_command(CLI::App& app) {
  auto* command = app.add_subcommand("expose", R"(Tell how well a sweep was exposed, and what would be better.

From one sweep over a page: how many of the pixels that the stripe passed are clipped, how many are
too dark, how much of the range of gray values is used, and which exposure time, gain and speed
would use it better. Every report of `scan` and `reconstruct` has the same figures.
)");
  const auto arguments = std::make_shared<Arguments>();
  arguments->input.add_to(*command);
  add_common_options(*command, arguments->common);
  command->footer(R"(Examples:
  pagesweep expose sweep
  pagesweep expose sweep --json | jq .cam1.light_factor
)");
  command->callback([arguments] { run(*arguments); });
}

}  // namespace pagesweep::cli
