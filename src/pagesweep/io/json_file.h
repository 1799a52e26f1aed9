// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace pagesweep {

/// JSON for people: two spaces a level; arrays and objects that fit stay on one line.
std::string format_json(const nlohmann::ordered_json& value);

/// Writes format_json(value) to a file.
/// \throws Error  if it cannot be written
void write_json(const std::filesystem::path& file, const nlohmann::ordered_json& value);

}  // namespace pagesweep
