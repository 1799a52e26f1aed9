// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

namespace pagesweep::sim {

/// A field that no one knows is a misspelt one: its value would be lost silently.
/// \throws Error  that names the field, its place, and those that are known there
void require_known_scene_fields(const std::filesystem::path& file);

}  // namespace pagesweep::sim
