// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/quality/standards.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace pagesweep {
namespace {

constexpr double none = std::numeric_limits<double>::quiet_NaN();

// Resolution, noise and sampling efficiency: a published comparison of both documents. Non-uniformity: FADGI's values
// of 2010. Scale: the tolerances that FADGI puts on the resolution.
constexpr std::array requirements{
    Requirement{"resolution_across", {396, 294, 242.5, 190}, {none, none, none}, true},
    Requirement{"resolution_down", {396, 294, 242.5, 190}, {none, none, none}, true},
    Requirement{"sampling_efficiency_across", {90, 80, 70, 60}, {85, 80, 70}, true},
    Requirement{"sampling_efficiency_down", {90, 80, 70, 60}, {85, 80, 70}, true},
    Requirement{"noise", {1, 2, 3, 4}, {1.6, 2, 2.2}},
    Requirement{"non_uniformity", {1, 3, 5, none}, {none, none, none}},
    Requirement{"scale_error_across", {1, 2, 3, 5}, {none, none, none}},
    Requirement{"scale_error_down", {1, 2, 3, 5}, {none, none, none}},
};

/// The first limit that a value keeps; their number if it keeps none.
template <std::size_t N>
std::size_t first_kept(const std::array<double, N>& limits, double value, bool more_is_better) {
  for (std::size_t k = 0; k < N; ++k)
    if (more_is_better ? value >= limits[k] : std::abs(value) <= limits[k]) return k;
  return N;
}

}  // namespace

const Requirement* find_requirement(std::string_view figure) {
  const auto at = std::ranges::find(requirements, figure, &Requirement::name);
  return at == requirements.end() ? nullptr : &*at;
}

std::string fadgi_level(std::string_view figure, double value) {
  const Requirement* requirement = find_requirement(figure);
  if (!requirement || std::isnan(value) || std::isnan(requirement->fadgi_stars[0])) return "";
  const std::size_t k = first_kept(requirement->fadgi_stars, value, requirement->more_is_better);
  constexpr std::array<std::string_view, 5> names{"4 stars", "3 stars", "2 stars", "1 star", "below 1 star"};
  if (k == 4 && std::isnan(requirement->fadgi_stars[3])) return std::string(names[3]);
  return std::string(names[k]);
}

std::string iso_level(std::string_view figure, double value) {
  const Requirement* requirement = find_requirement(figure);
  if (!requirement || std::isnan(value) || std::isnan(requirement->iso_levels[0])) return "";
  constexpr std::array<std::string_view, 4> names{"A", "B", "C", "below C"};
  return std::string(names[first_kept(requirement->iso_levels, value, requirement->more_is_better)]);
}

}  // namespace pagesweep
