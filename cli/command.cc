// SPDX-License-Identifier: Apache-2.0
#include "cli/command.h"

#include <fmt/core.h>

#include <nlohmann/json.hpp>

#include "pagesweep/base/error.h"

namespace pagesweep::cli {

void add_common_options(CLI::App& command, CommonOptions& options) {
  const std::string group = "Common options";
  command.add_flag("-q,--quiet", options.quiet, "tell nothing but errors on the way")->group(group);
  command.add_flag("--json", options.json, "print the answer as JSON, for programs")->group(group);
  command.add_option("--threads", options.threads, "how many threads may work; 0: one a core [0]")
      ->group(group)
      ->option_text("<number>")
      ->check(CLI::NonNegativeNumber);
  command.set_help_flag("");  // made anew, so that it stands with these
  command.set_help_flag("-h,--help", "print this help")->group(group);
}

void add_input(CLI::App& command, const std::string& name, std::filesystem::path& field, const std::string& help) {
  command.add_option(name, field, help)->required();
}

void add_output(CLI::App& command, std::filesystem::path& field, const std::string& help) {
  command.add_option("-o,--output", field, help)->required()->option_text("<folder>");
}

void print_answer(const CommonOptions& options, const nlohmann::ordered_json& json, const std::string& text) {
  if (options.json)
    fmt::print("{}\n", json.dump(2));
  else
    fmt::print("{}", text);
  if (std::fflush(stdout) != 0) throw Error(ErrorKind::cannot_write, "standard output cannot be written");
}

}  // namespace pagesweep::cli
