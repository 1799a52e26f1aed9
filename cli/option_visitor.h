// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdlib>
#include <string>
#include <string_view>
#include <type_traits>

#include "pagesweep/base/enum_names.h"

namespace pagesweep::cli {

/// Turns an options struct that describes itself (base/options.h) into options of a command: a name, the unit in place
/// of the value, the help text and the default come from the struct alone.
class OptionVisitor {
 public:
  /// \param group  heading of these options in the help
  OptionVisitor(CLI::App& command, std::string group) : command_(command), group_(std::move(group)) {}

  void operator()(std::string_view name, bool& field, std::string_view, std::string_view help) {
    command_.add_flag(field ? fmt::format("--{0},!--no-{0}", name) : fmt::format("--{}", name), field)
        ->group(group_)
        ->description(fmt::format("{} [{}]", help, field ? "on" : "off"));
  }

  void operator()(std::string_view name, std::string& field, std::string_view, std::string_view help) {
    add(name, field, "<text>", help, field);
  }

  template <class Number>
    requires std::is_arithmetic_v<Number>
  void operator()(std::string_view name, Number& field, std::string_view unit, std::string_view help) {
    add(name, field, unit.empty() ? "<number>" : fmt::format("<{}>", unit), help, fmt::format("{}", field))
        ->check(problem_of_number, "");
  }

  template <class Enum>
    requires std::is_enum_v<Enum>
  void operator()(std::string_view name, Enum& field, std::string_view, std::string_view help) {
    const auto choose = [&field](const std::string& text) {
      const auto value = value_named<Enum>(text);
      if (value) field = *value;
      return value.has_value();
    };
    command_
        .add_option(fmt::format("--{}", name),
                    [choose, name = std::string(name)](const CLI::results_t& texts) {
                      if (choose(texts.back())) return true;
                      throw CLI::ValidationError("--" + name, fmt::format("'{}' is none of {}", texts.back(),
                                                                          fmt::join(names_of(Enum{}), ", ")));
                    })
        ->group(group_)
        ->option_text(fmt::format("{}", fmt::join(names_of(Enum{}), "|")))
        ->description(fmt::format("{} [{}]", help, name_of(field)));
  }

 private:
  /// "" if it is a finite number, else what is wrong.
  static std::string problem_of_number(const std::string& text) {
    char* end = nullptr;
    const double value = std::strtod(text.c_str(), &end);
    return !text.empty() && *end == 0 && std::isfinite(value) ? "" : fmt::format("'{}' is no number", text);
  }

  template <class Field>
  CLI::Option* add(std::string_view name, Field& field, const std::string& placeholder, std::string_view help,
                   const std::string& preset) {
    return command_.add_option(fmt::format("--{}", name), field)
        ->group(group_)
        ->option_text(placeholder)
        ->description(preset.empty() ? std::string(help) : fmt::format("{} [{}]", help, preset));
  }

  CLI::App& command_;
  std::string group_;
};

}  // namespace pagesweep::cli
