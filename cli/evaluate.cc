// SPDX-License-Identifier: Apache-2.0
// pagesweep evaluate: a result against the truth.
#include "pagesweep/evaluation/evaluate.h"

#include <nlohmann/json.hpp>

#include "cli/command.h"
#include "cli/console_progress.h"
#include "cli/option_visitor.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/report/report.h"

namespace pagesweep::cli {
namespace {

struct Arguments {
  CommonOptions common;
  std::filesystem::path result;
  std::filesystem::path truth;
  EvaluationOptions options;
};

void run(const Arguments& arguments) {
  const ThreadLimit limit(arguments.common.threads);
  ConsoleProgress progress(arguments.common.quiet);
  const Evaluation evaluation = evaluate(arguments.result, arguments.truth, arguments.options, progress);
  const auto figures = figures_of(evaluation);
  if (std::filesystem::exists(arguments.result / "report.html")) {
    progress.begin("adding the errors to the report");
    add_evaluation(arguments.result, figures, maps_of(evaluation));
  }
  progress.finish();
  print_answer(arguments.common, nlohmann::ordered_json::parse(format_figures_json(figures)), format_table(figures));
}

}  // namespace

void add_evaluate_command(CLI::App& app) {
  auto* command = app.add_subcommand("evaluate", R"(Compare a result with the truth of a simulated capture.

Prints the distances of the points to the true surface, the errors of the time values, and by
how many millimetres the print of each flat page is out of place. A figure that cannot be found
says why. The result's report.html gets a section with the same figures and with maps of the
errors.
)");
  const auto arguments = std::make_shared<Arguments>();
  add_input(*command, "RESULT", arguments->result, "folder that scan or reconstruct wrote");
  command->add_option("--truth", arguments->truth, "folder with truth.json")->required()->option_text("<folder>");
  arguments->options.describe(OptionVisitor(*command, "Comparison"));
  add_common_options(*command, arguments->common);
  command->footer(
      "Examples:\n  pagesweep evaluate result --truth capture/truth\n"
      "  pagesweep evaluate result --truth capture/truth --json > figures.json\n");
  command->callback([arguments] { run(*arguments); });
}

}  // namespace pagesweep::cli
