// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "pagesweep/acceptance/measure_artefact.h"
#include "pagesweep/base/enum_names.h"
#include "pagesweep/report/report.h"

namespace pagesweep {

/// The maximum permissible errors. 0: no limit.
struct AcceptanceLimits {
  double flatness_mm = 0;
  double probing_form_mm = 0;
  double probing_size_mm = 0;
  double sphere_spacing_mm = 0;

  template <class Visitor>
  void describe(Visitor&& visit) {
    visit("max-flatness", flatness_mm, "mm", "largest flatness measurement error that passes; 0: no limit");
    visit("max-probing-form", probing_form_mm, "mm", "likewise of the probing error form");
    visit("max-probing-size", probing_size_mm, "mm", "likewise of the probing error size, to both sides");
    visit("max-sphere-spacing", sphere_spacing_mm, "mm", "likewise of the sphere spacing error, to both sides");
  }
};

/// One quality parameter in all poses.
struct QualityParameter {
  std::string name;            ///< a key for scripts: "sphere_spacing"
  std::string symbol;          ///< of the guideline, "SD"; empty: it does not have this one
  std::string what;            ///< in words for people
  std::string unit;            ///< "" for a ratio
  std::vector<double> values;  ///< one a pose, the worse of both spheres; NaN where it was not measured
  double limit = 0;            ///< 0: none

  /// The value that is farthest from 0; NaN if there is none.
  double worst() const;
  /// A limit is not kept if nothing was measured.
  bool is_kept() const { return limit == 0 || std::abs(worst()) <= limit; }
};

enum class AcceptanceVerdict {
  passed,     ///< all limits are kept
  failed,     ///< one is not
  no_limits,  ///< none was given
};
constexpr auto names_of(AcceptanceVerdict) { return std::array<std::string_view, 3>{"passed", "failed", "no_limits"}; }

/// An acceptance test after VDI/VDE 2634 part 2.
struct Acceptance {
  Artefact artefact;
  std::vector<PoseResult> poses;
  std::vector<QualityParameter> parameters;
  AcceptanceVerdict verdict = AcceptanceVerdict::no_limits;
  std::string headline;              ///< one sentence: the verdict with its reason
  std::vector<std::string> remarks;  ///< what is missing
};

/// \throws std::invalid_argument  if a limit is negative
Acceptance judge_acceptance(const Artefact& artefact, std::vector<PoseResult> poses, const AcceptanceLimits& limits);

/// What goes into the page beside the test itself.
struct AcceptanceReport {
  std::string program;  ///< "pagesweep 0.1.0"
  std::vector<OptionValue> options;
};

/// {"format": "pagesweep-acceptance", "version": 1, ...}: docs/formats.md, "Acceptance".
std::string format_acceptance_json(const Acceptance& acceptance, const AcceptanceReport& report);

/// A table for people: the worst value of each parameter, its limit, the headline.
std::string format_acceptance_table(const Acceptance& acceptance);

/// Writes folder / "acceptance.html" (one self-contained page) and then folder / "acceptance.json".
/// \throws Error  if a file cannot be written
void write_acceptance(const std::filesystem::path& folder, const Acceptance& acceptance,
                      const AcceptanceReport& report);

}  // namespace pagesweep
