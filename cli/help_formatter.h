// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace pagesweep::cli {

/// Help of at most 100 columns: what the command does, its usage, its options group by group in the order of their
/// making, examples. Descriptions stand beside the names or, after a long name, on lines of their own.
class HelpFormatter : public CLI::Formatter {
 public:
  std::string make_help(const CLI::App* app, std::string name, CLI::AppFormatMode mode) const override;
  std::string make_option(const CLI::Option* option, bool is_positional) const override;
  std::string make_subcommand(const CLI::App* command) const override;
};

}  // namespace pagesweep::cli
