// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace pagesweep::cli {

/// Options that every subcommand has.
struct CommonOptions {
  bool quiet = false;
  bool json = false;
  int threads = 0;
};
void add_common_options(CLI::App& command, CommonOptions& options);

/// A folder or file that a command needs, by place: "CAPTURE".
void add_input(CLI::App& command, const std::string& name, std::filesystem::path& field, const std::string& help);
/// The folder to write: -o, --output.
void add_output(CLI::App& command, std::filesystem::path& field, const std::string& help);

/// The answer of a command on stdout: `json` for programs if asked for, `text` for people otherwise.
void print_answer(const CommonOptions& options, const nlohmann::ordered_json& json, const std::string& text);

// Each adds one subcommand, whose callback does the work.
void add_scan_command(CLI::App& app);
void add_reconstruct_command(CLI::App& app);
void add_dewarp_command(CLI::App& app);
void add_deliver_command(CLI::App& app);
void add_simulate_command(CLI::App& app);
void add_evaluate_command(CLI::App& app);
void add_plan_command(CLI::App& app);
void add_acceptance_command(CLI::App& app);
void add_board_command(CLI::App& app);
void add_calibrate_command(CLI::App& app);
void add_convert_command(CLI::App& app);
void add_check_command(CLI::App& app);
void add_rig_command(CLI::App& app);
void add_info_command(CLI::App& app);
void add_expose_command(CLI::App& app);
void add_cameras_command(CLI::App& app);
void add_capture_command(CLI::App& app);
void add_fake_rig_command(CLI::App& app);

}  // namespace pagesweep::cli
