// SPDX-License-Identifier: Apache-2.0
// pagesweep evaluate: a result against the truth.
#include "pagesweep/evaluation/evaluate.h"

#include <nlohmann/json.hpp>

#include "cli/command.h"
#include "cli/console_progress.h"
#include "cli/option_visitor.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/evaluation/compare_rigs.h"
#include "pagesweep/io/rig_file.h"
#include "pagesweep/report/report.h"

namespace pagesweep::cli {
namespace {

struct Arguments {
  CommonOptions common;
  std::filesystem::path result;
  std::filesystem::path truth;
  EvaluationOptions options;
  RigComparisonOptions rigs;
};

void run_on_rigs(const Arguments& arguments) {
  const auto figures = figures_of(compare_rigs(read_rig(arguments.result), read_rig(arguments.truth), arguments.rigs));
  print_answer(arguments.common, nlohmann::ordered_json::parse(format_figures_json(figures)), format_table(figures));
}

void run(const Arguments& arguments) {
  if (std::filesystem::is_regular_file(arguments.result)) return run_on_rigs(arguments);
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

Of a rig it tells by how much points and places in the scan are off because of it, in a
volume over the table, after the best rigid motion between the frames.
)");
  const auto arguments = std::make_shared<Arguments>();
  add_input(*command, "RESULT", arguments->result, "folder that scan or reconstruct wrote, or a rig");
  command->add_option("--truth", arguments->truth, "folder with truth.json, or the true rig")
      ->required()
      ->option_text("<folder>");
  arguments->options.describe(OptionVisitor(*command, "Comparison"));
  arguments->rigs.describe(OptionVisitor(*command, "Comparison of rigs"));
  add_common_options(*command, arguments->common);
  command->footer(
      "Examples:\n  pagesweep evaluate result --truth capture/truth\n"
      "  pagesweep evaluate result --truth capture/truth --json > figures.json\n"
      "  pagesweep evaluate rig.json --truth true_rig.json\n");
  command->callback([arguments] { run(*arguments); });
}

}  // namespace pagesweep::cli
