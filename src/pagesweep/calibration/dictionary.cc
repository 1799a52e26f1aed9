// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <array>
#include <stdexcept>
#include <utility>

#include "pagesweep/calibration/detect_board.h"
#include "pagesweep/calibration/dictionary_internal.h"

namespace pagesweep {
namespace {

namespace aruco = cv::aruco;

constexpr auto dictionaries = std::to_array<std::pair<const char*, aruco::PREDEFINED_DICTIONARY_NAME>>({
    {"DICT_4X4_50", aruco::DICT_4X4_50},
    {"DICT_4X4_100", aruco::DICT_4X4_100},
    {"DICT_4X4_250", aruco::DICT_4X4_250},
    {"DICT_4X4_1000", aruco::DICT_4X4_1000},
    {"DICT_5X5_50", aruco::DICT_5X5_50},
    {"DICT_5X5_100", aruco::DICT_5X5_100},
    {"DICT_5X5_250", aruco::DICT_5X5_250},
    {"DICT_5X5_1000", aruco::DICT_5X5_1000},
    {"DICT_6X6_50", aruco::DICT_6X6_50},
    {"DICT_6X6_100", aruco::DICT_6X6_100},
    {"DICT_6X6_250", aruco::DICT_6X6_250},
    {"DICT_6X6_1000", aruco::DICT_6X6_1000},
    {"DICT_7X7_50", aruco::DICT_7X7_50},
    {"DICT_7X7_100", aruco::DICT_7X7_100},
    {"DICT_7X7_250", aruco::DICT_7X7_250},
    {"DICT_7X7_1000", aruco::DICT_7X7_1000},
    {"DICT_ARUCO_ORIGINAL", aruco::DICT_ARUCO_ORIGINAL},
    {"DICT_APRILTAG_16h5", aruco::DICT_APRILTAG_16h5},
    {"DICT_APRILTAG_25h9", aruco::DICT_APRILTAG_25h9},
    {"DICT_APRILTAG_36h10", aruco::DICT_APRILTAG_36h10},
    {"DICT_APRILTAG_36h11", aruco::DICT_APRILTAG_36h11},
});

}  // namespace

std::vector<std::string> dictionary_names() {
  std::vector<std::string> names;
  for (const auto& [name, value] : dictionaries) names.emplace_back(name);
  return names;
}

cv::Ptr<aruco::Dictionary> dictionary_named(const std::string& name) {
  for (const auto& [known, value] : dictionaries)
    if (name == known) return aruco::getPredefinedDictionary(value);
  throw std::invalid_argument(fmt::format("no dictionary of markers is called '{}'; DICT_5X5_1000 is one", name));
}

std::vector<MarkerPlace> marker_places(const Board& board) {
  std::vector<MarkerPlace> places;
  for (int row = board.rows - 1; row >= 0; --row)
    for (int column = 0; column < board.columns; ++column)
      if (!board.is_black(column, row)) places.push_back({column, row});
  return places;
}

}  // namespace pagesweep
