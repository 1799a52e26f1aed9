// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "pagesweep/planning/plan.h"

namespace pagesweep {

/// What a plan says in a terminal: how accurate, what limits it, and what would change it.
std::string format_plan_text(const Plan& plan);

/// The same for programs: plan.json (docs/formats.md).
/// \param with_maps  and the values over the table
std::string format_plan_json(const Plan& plan, bool with_maps);

/// Writes folder / "plan.html" (one self-contained page with maps) and then folder / "plan.json".
/// \param title    of the page: the rig's name
/// \param program  "pagesweep 0.1.0"
/// \throws Error  if a file cannot be written
void write_plan(const std::filesystem::path& folder, const Plan& plan, const std::string& title,
                const std::string& program);

}  // namespace pagesweep
