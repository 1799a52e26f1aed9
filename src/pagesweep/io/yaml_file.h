// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "pagesweep/io/json_reader.h"

namespace pagesweep {

/// The first document of a YAML file as the JSON that says the same, so that one reader checks both. Numbers are what
/// C calls so, also "1." and "+.5e3"; all other scalars become strings, also those that YAML calls true or null. Tags
/// are passed over, as is the first line of OpenCV's files, "%YAML:1.0", which is no directive of YAML.
/// \throws Error  if the file cannot be read or is no YAML, or grows beyond measure when its aliases are followed
JsonReader read_yaml(const std::filesystem::path& file);

}  // namespace pagesweep
