// SPDX-License-Identifier: Apache-2.0
// pagesweep info: what a file or folder is, in plain words, and whether it is sound.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

#include "cli/capture_input.h"
#include "cli/command.h"
#include "cli/console_progress.h"
#include "cli/describe.h"
#include "pagesweep/base/error.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/delivery/mets.h"
#include "pagesweep/io/image_file.h"
#include "pagesweep/io/json_reader.h"
#include "pagesweep/io/ply_file.h"
#include "pagesweep/io/rig_file.h"
#include "pagesweep/io/truth_file.h"

namespace pagesweep::cli {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  CommonOptions common;
  fs::path input;
};

/// Reads the recording to its end: what is broken in it comes out as an Error.
Description inspect_capture(const fs::path& path, Progress& progress) {
  const auto [capture, rig, source] = open({.capture = path, .rig = {}, .picture = {}});
  const std::vector<Frames> frames = read_all(*source, progress);
  Description description = describe_capture(capture, frames);
  description.add("rig", describe_rig(rig));
  if (const auto scan = capture.scan_path()) description.add("scan", describe_picture(*scan, read_picture(*scan)));
  return description;
}

Description inspect_json(const fs::path& file, Progress& progress) {
  const auto format = JsonReader::read(file).at("format").text();
  if (format == "pagesweep-capture") return inspect_capture(file, progress);
  if (format == "pagesweep-rig") return describe_rig(read_rig(file));
  if (format == "pagesweep-truth") return describe_truth(read_truth(file));
  if (format == "pagesweep-report") return describe_report(JsonReader::read(file));
  throw bad_input(file, "format", fmt::format("'{}' is no format that pagesweep knows", format));
}

/// Reads every file that was delivered: one that is missing or was changed comes out as an Error.
Description inspect_job(const fs::path& folder, Progress& progress) {
  progress.begin("comparing the files with mets.xml");
  const MetsListing listing = read_mets(folder / "mets.xml");
  check_files(folder, listing);
  Description description;
  description.lines.push_back(fmt::format("a job, '{}': {} pages, {} files, all as they were delivered", listing.title,
                                          listing.pages, listing.files.size()));
  description.json = {
      {"kind", "job"}, {"title", listing.title}, {"pages", listing.pages}, {"files", listing.files.size()}};
  return description;
}

Description inspect_folder(const fs::path& folder, Progress& progress) {
  if (fs::exists(folder / "mets.xml")) return inspect_job(folder, progress);
  for (const char* index : {"capture.json", "report.json", "truth.json"})
    if (fs::exists(folder / index)) return inspect_json(folder / index, progress);
  throw bad_input(folder, "",
                  "holds neither capture.json (a capture), report.json (a result), truth.json (reference data) nor "
                  "mets.xml (a job); a result without report.json or a job without mets.xml is unfinished");
}

Description inspect(const fs::path& path, Progress& progress) {
  if (!fs::exists(path)) throw cannot_read(path, "there is no such file or folder");
  if (fs::is_directory(path)) return inspect_folder(path, progress);
  if (path.extension() == ".json") return inspect_json(path, progress);
  if (path.extension() == ".ply") return describe_points(read_ply(path));
  return describe_picture(path, read_picture(path));
}

void run(const Arguments& arguments) {
  const ThreadLimit limit(arguments.common.threads);
  ConsoleProgress progress(arguments.common.quiet);
  const Description description = inspect(arguments.input, progress);
  progress.finish();
  print_answer(arguments.common, description.json, description.text());
}

}  // namespace

void add_info_command(CLI::App& app) {
  auto* command = app.add_subcommand("info", R"(Say what a file or folder is, and whether it is sound.

Knows captures, rigs, results, jobs, reference data, point clouds (PLY) and pictures. A capture
is read to its last frame: what is broken in it is found here, before a measurement. Of a job
every file is compared with the checksum in mets.xml.
)");
  const auto arguments = std::make_shared<Arguments>();
  add_input(*command, "PATH", arguments->input, "a file or a folder");
  add_common_options(*command, arguments->common);
  command->footer("Examples:\n  pagesweep info capture\n  pagesweep info capture/rig.json --json\n");
  command->callback([arguments] { run(*arguments); });
}

}  // namespace pagesweep::cli
