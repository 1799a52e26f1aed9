// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/json_file.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <vector>

#include "pagesweep/io/atomic_file.h"

namespace pagesweep {
namespace {

using nlohmann::ordered_json;

constexpr std::size_t line_length = 110;
constexpr auto replace_bad_utf8 = ordered_json::error_handler_t::replace;

std::string dump(const ordered_json& value) { return value.dump(-1, ' ', false, replace_bad_utf8); }

std::string key_prefix(const ordered_json& parent, const std::string& key) {
  return parent.is_object() ? fmt::format("{}: ", dump(key)) : "";
}

std::string brackets(const ordered_json& parent, std::string_view content) {
  return parent.is_object() ? fmt::format("{{{}}}", content) : fmt::format("[{}]", content);
}

/// On one line with a space after each comma and colon.
std::string format_line(const ordered_json& value) {
  if (!value.is_structured()) return dump(value);
  std::vector<std::string> items;
  for (const auto& [key, item] : value.items()) items.push_back(key_prefix(value, key) + format_line(item));
  return brackets(value, fmt::format("{}", fmt::join(items, ", ")));
}

bool is_row_of_scalars(const ordered_json& value) {
  return value.is_array() && std::ranges::none_of(value, [](const auto& item) { return item.is_structured(); });
}

std::string format(const ordered_json& value, std::size_t indent) {
  if (!value.is_structured() || value.empty() || is_row_of_scalars(value)) return format_line(value);
  if (std::string line = format_line(value); indent > 0 && indent + line.size() <= line_length) return line;
  std::vector<std::string> items;
  for (const auto& [key, item] : value.items()) items.push_back(key_prefix(value, key) + format(item, indent + 2));
  const std::string margin(indent, ' ');
  return brackets(value, fmt::format("\n{0}  {1}\n{0}", margin, fmt::join(items, fmt::format(",\n{}  ", margin))));
}

}  // namespace

std::string format_json(const ordered_json& value) { return format(value, 0) + "\n"; }

void write_json(const std::filesystem::path& file, const ordered_json& value) { write_bytes(file, format_json(value)); }

}  // namespace pagesweep
