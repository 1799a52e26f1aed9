// SPDX-License-Identifier: Apache-2.0
// pagesweep deliver: flat pages to what a digitisation workshop hands over.
#include "pagesweep/delivery/deliver.h"

#include <fmt/chrono.h>

#include <chrono>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "cli/command.h"
#include "cli/console_progress.h"
#include "cli/option_visitor.h"
#include "pagesweep/base/error.h"
#include "pagesweep/base/parallel.h"

namespace pagesweep::cli {
namespace {

struct Arguments {
  CommonOptions common;
  std::vector<std::filesystem::path> results;
  std::filesystem::path output;
  DeliveryOptions options;
};

/// Now, or what SOURCE_DATE_EPOCH says, so that a job can be made again bit by bit.
std::string date_of_job() {
  const char* fixed = std::getenv("SOURCE_DATE_EPOCH");
  const std::time_t now = fixed ? static_cast<std::time_t>(std::strtoll(fixed, nullptr, 10))
                                : std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  return fmt::format("{:%Y-%m-%dT%H:%M:%S}Z", fmt::gmtime(now));
}

nlohmann::ordered_json to_json(const DeliveredFile& file) {
  return {{"group", file.group}, {"path", file.path}, {"size", file.size_bytes}, {"sha256", file.sha256}};
}

nlohmann::ordered_json to_json(const Delivery& delivery) {
  nlohmann::ordered_json json = {{"format", "pagesweep-delivery"}, {"version", 1}, {"reused", delivery.reused}};
  json["pages"] = nlohmann::ordered_json::array();
  for (const DeliveredPage& page : delivery.pages) {
    json["pages"].push_back({{"name", page.name}, {"label", page.label}, {"files", nlohmann::ordered_json::array()}});
    for (const DeliveredFile& file : page.files) json["pages"].back()["files"].push_back(to_json(file));
  }
  json["files"] = nlohmann::ordered_json::array();
  for (const DeliveredFile& file : delivery.of_the_job) json["files"].push_back(to_json(file));
  return json;
}

std::string to_text(const Delivery& delivery, const std::filesystem::path& folder) {
  std::size_t files = delivery.of_the_job.size();
  for (const DeliveredPage& page : delivery.pages) files += page.files.size();
  std::string text = fmt::format("{} pages in {} files", delivery.pages.size(), files);
  if (delivery.reused > 0) text += fmt::format("; {} pages were there from a run that was broken off", delivery.reused);
  return text + "\nIndex: " + (folder / "mets.xml").string() + "\n";
}

void run(const Arguments& arguments) {
  const ThreadLimit limit(arguments.common.threads);
  ConsoleProgress progress(arguments.common.quiet);
  if (std::filesystem::exists(arguments.output) && !std::filesystem::is_directory(arguments.output))
    throw cannot_write(arguments.output, "it is a file, and a folder is needed");
  const auto pages = find_pages(arguments.results);
  const Delivery delivery =
      deliver(pages, arguments.output, arguments.options, {"pagesweep " PAGESWEEP_VERSION, date_of_job()}, progress);
  progress.finish();
  print_answer(arguments.common, to_json(delivery), to_text(delivery, arguments.output));
}

}  // namespace

void add_deliver_command(CLI::App& app) {
  auto* command = app.add_subcommand("deliver", R"(Make of flat pages what a workshop hands over: one job of many scans.

Takes the pages of results, in the order given and from left to right within each, and writes

  tiff/, png/, jpeg/, jp2/ the pages, named by a pattern, in the formats that are asked for
  JOB.pdf                  all of them as PDF/A-2b; with --ocr the text can be searched
  hocr/, alto/             with --ocr: the text and where it stands, in pixels of the page
  mets.xml                 what there is, with checksums, in the order of the pages; written last

A run that was broken off goes on where it was, if it is started again with the same options.
)");
  const auto arguments = std::make_shared<Arguments>();
  command->add_option("RESULT", arguments->results, "folders that scan or dewarp wrote, or pictures of flat pages")
      ->required()
      ->option_text(" ");
  add_output(*command, arguments->output, "where the job goes; its name is the job's");
  arguments->options.describe(OptionVisitor(*command, "Deliverables"));
  add_common_options(*command, arguments->common);
  command->footer(R"(Examples:
  pagesweep deliver result -o faust
  pagesweep deliver results/* -o faust --ocr deu --formats jp2,pdf --page-name 'faust_{page:04}'
  pagesweep deliver front.tif results/* -o faust --first-page 0 --title 'Faust, part 1'
)");
  command->callback([arguments] { run(*arguments); });
}

}  // namespace pagesweep::cli
