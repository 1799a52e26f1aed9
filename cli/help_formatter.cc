// SPDX-License-Identifier: Apache-2.0
#include "cli/help_formatter.h"

#include <sstream>

namespace pagesweep::cli {
namespace {

constexpr std::size_t description_column = 30;
constexpr std::size_t last_column = 100;

std::string entry(std::string name, const std::string& description) {
  std::string text;
  std::string line = "  " + std::move(name);
  const auto end_line = [&] {
    text += line + "\n";
    line.clear();
  };
  if (line.size() + 2 > description_column) end_line();
  line.resize(description_column, ' ');
  bool begun = false;  // of a line's words
  std::istringstream words(description);
  for (std::string word; words >> word; begun = true) {
    if (begun && line.size() + 1 + word.size() > last_column) {
      end_line();
      line.resize(description_column, ' ');
      begun = false;
    }
    line += (begun ? " " : "") + word;
  }
  end_line();
  return text;
}

std::string names_of_option(const CLI::Option& option) {
  if (!option.get_fnames().empty()) return "--[no-]" + option.get_lnames().front();
  std::string names;
  for (const auto& name : option.get_snames()) names += (names.empty() ? "-" : ", -") + name;
  for (const auto& name : option.get_lnames()) names += (names.empty() ? "--" : ", --") + name;
  return names;
}

}  // namespace

std::string HelpFormatter::make_help(const CLI::App* app, std::string name, CLI::AppFormatMode) const {
  std::string text = app->get_description() + "\n" + make_usage(app, std::move(name));
  const auto add_group = [&](const std::string& heading, const std::string& entries) {
    if (!entries.empty()) text += "\n" + heading + ":\n" + entries;
  };
  for (const std::string& group : app->get_groups()) {
    std::string entries;
    for (const bool positional : {true, false})
      for (const CLI::Option* option : app->get_options())
        if (option->get_group() == group && option->get_positional() == positional)
          entries += make_option(option, positional);
    add_group(group, entries);
  }
  std::string commands;
  for (const CLI::App* command : app->get_subcommands({})) commands += make_subcommand(command);
  add_group("Commands", commands);
  return text + "\n" + app->get_footer();
}

std::string HelpFormatter::make_option(const CLI::Option* option, bool is_positional) const {
  std::string name = is_positional ? option->get_name(true, false) : names_of_option(*option);
  if (!is_positional && !option->get_option_text().empty()) name += " " + option->get_option_text();
  return entry(std::move(name), option->get_description());
}

std::string HelpFormatter::make_subcommand(const CLI::App* command) const {
  const std::string& description = command->get_description();
  return entry(command->get_name(), description.substr(0, description.find('\n')));
}

}  // namespace pagesweep::cli
