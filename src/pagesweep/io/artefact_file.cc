// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/artefact_file.h"

#include <fmt/format.h>

#include <algorithm>

#include "pagesweep/io/json_reader.h"

namespace pagesweep {
namespace {

constexpr double smallest_mm = 1, largest_mm = 10000;

Eigen::Vector2d read_plate(const JsonReader& json) {
  const JsonReader size = json.at("size_mm");
  const std::vector<double> sides = size.numbers();
  if (sides.size() != 2) throw size.error(fmt::format("expected 2 numbers, found {}", sides.size()));
  const auto [shorter, longer] = std::minmax(sides[0], sides[1]);
  if (!(shorter >= smallest_mm && longer <= largest_mm))
    throw size.error(fmt::format("expected sides from {} to {}", smallest_mm, largest_mm));
  return {longer, shorter};
}

double read_spacing(const JsonReader& json, const std::vector<double>& diameters) {
  if (diameters.size() != 2) throw json.error("needs two spheres");
  const double spacing = json.number(smallest_mm, largest_mm);
  if (spacing < 0.5 * (diameters[0] + diameters[1])) throw json.error("expected spheres that do not overlap");
  return spacing;
}

}  // namespace

Artefact read_artefact(const std::filesystem::path& file) {
  const JsonReader json = JsonReader::read(file);
  json.expect_format("pagesweep-artefact", 1);
  Artefact artefact;
  if (const auto name = json.find("name")) artefact.name = name->text();
  if (const auto plate = json.find("plate")) artefact.plate_mm = read_plate(*plate);
  if (const auto spheres = json.find("spheres")) {
    for (const JsonReader& sphere : spheres->items())
      artefact.sphere_diameters_mm.push_back(sphere.at("diameter_mm").number(smallest_mm, largest_mm));
    if (artefact.sphere_diameters_mm.size() > 2) throw spheres->error("expected one or two spheres");
  }
  if (const auto spacing = json.find("spacing_mm"))
    artefact.spacing_mm = read_spacing(*spacing, artefact.sphere_diameters_mm);
  if (!artefact.plate_mm && artefact.sphere_diameters_mm.empty())
    throw json.error("expected a plate or spheres: there is nothing to measure");
  return artefact;
}

}  // namespace pagesweep
