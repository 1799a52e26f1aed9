// SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <new>
#include <stdexcept>

#include "cli/command.h"
#include "cli/exit_code.h"
#include "cli/help_formatter.h"
#include "cli/interrupt.h"
#include "cli/memory.h"

namespace pagesweep::cli {
namespace {

constexpr const char* description =
    R"(Measures the pages of an open book from the light stripe of a top-view scanner, and flattens its picture.
)";

constexpr const char* footer = R"(Try it without a scanner:
  pagesweep simulate scenes/spread.json --preview -o capture
  pagesweep scan capture -o result
  pagesweep evaluate result --truth capture/truth

Exit status: 0 done; 1 a defect of this program; 2 wrong usage; 3 an input that cannot be used;
4 an input that cannot be read; 5 an output that cannot be written; 6 nothing could be measured;
7 a limit of an acceptance test is exceeded; 128 + n ended by signal n.
)";

void add_commands(CLI::App& app) {
  const auto formatter = std::make_shared<HelpFormatter>();
  formatter->label("SUBCOMMAND", "COMMAND");
  app.formatter(formatter);
  app.footer(footer);
  app.require_subcommand(1);
  app.set_version_flag("--version", std::string("pagesweep " PAGESWEEP_VERSION), "print the version");
  app.get_help_ptr()->description("print this help");
  add_scan_command(app);
  add_reconstruct_command(app);
  add_dewarp_command(app);
  add_deliver_command(app);
  add_simulate_command(app);
  add_evaluate_command(app);
  add_plan_command(app);
  add_acceptance_command(app);
  add_board_command(app);
  add_calibrate_command(app);
  add_convert_command(app);
  add_check_command(app);
  add_rig_command(app);
  add_info_command(app);
  add_expose_command(app);
  add_cameras_command(app);
  add_capture_command(app);
  add_fake_rig_command(app);
}

std::string name_of_command(const CLI::App& app) {
  const auto commands = app.get_subcommands();
  return commands.empty() ? app.get_name() : app.get_name() + " " + commands.front()->get_name();
}

int complain(int code, const std::string& message) {
  fmt::print(stderr, "pagesweep: {}\n", message);
  return code;
}

int run(CLI::App& app, int argc, char** argv) {
  try {
    app.parse(argc, argv);
    return success;
  } catch (const CLI::Success& help) {
    return app.exit(help);
  } catch (const CLI::ParseError& error) {
    return complain(usage_error, fmt::format("{} (see {} --help)", error.what(), name_of_command(app)));
  } catch (const Error& error) {
    return complain(exit_code_of(error.kind()), error.what());
  } catch (const std::invalid_argument& error) {  // an option's value that a station refuses
    return complain(usage_error, error.what());
  } catch (const LimitExceeded&) {  // the answer has said so
    return limit_exceeded;
  } catch (const Interrupted& interrupted) {
    return complain(128 + interrupted.signal, "interrupted");
  } catch (const std::bad_alloc&) {
    return complain(internal_error, "the memory does not suffice for an input of this size");
  } catch (const std::exception& error) {
    return complain(internal_error, fmt::format("internal error: {}", error.what()));
  }
}

}  // namespace
}  // namespace pagesweep::cli

int main(int argc, char** argv) {
  pagesweep::cli::return_unused_memory();
  pagesweep::cli::catch_interrupts();
  CLI::App app(pagesweep::cli::description, "pagesweep");
  pagesweep::cli::add_commands(app);
  return pagesweep::cli::run(app, argc, argv);
}
