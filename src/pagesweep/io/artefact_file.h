// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace pagesweep {

/// A calibrated measure for instruments: what is known of it without measuring. A part that it does not have is absent.
struct Artefact {
  std::string name;                         ///< for people: maker and number, date of calibration
  std::optional<Eigen::Vector2d> plate_mm;  ///< sides of a flat rectangle, the longer one first
  std::vector<double> sphere_diameters_mm;  ///< none, one or two
  std::optional<double> spacing_mm;         ///< of the two spheres' centres
};

/// Reads an artefact file (docs/formats.md, "Artefact").
/// \throws Error  that names file, field and what was expected
Artefact read_artefact(const std::filesystem::path& file);

}  // namespace pagesweep
