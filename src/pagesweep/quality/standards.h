// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>

namespace pagesweep {

/// What FADGI (2023, bound volumes: general collections) and ISO 19264-1:2021 ask of one quantity. Where each number
/// comes from: docs/quality.md.
struct Requirement {
  std::string_view name;              ///< of the quality figure that it judges
  std::array<double, 4> fadgi_stars;  ///< limits for 4, 3, 2 and 1 stars; NaN: none known
  std::array<double, 3> iso_levels;   ///< limits for A, B and C; NaN: none known
  bool more_is_better = false;
};

/// The requirement for a figure; nullptr if neither knows that quantity.
const Requirement* find_requirement(std::string_view figure);

/// "4 stars" ... "1 star", "below 1 star"; empty if there is no limit.
std::string fadgi_level(std::string_view figure, double value);
/// "A", "B", "C", "below C"; empty if there is no limit.
std::string iso_level(std::string_view figure, double value);

}  // namespace pagesweep
