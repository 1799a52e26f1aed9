// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/io/board_file.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <nlohmann/json.hpp>

#include "pagesweep/io/json_file.h"
#include "pagesweep/io/json_reader.h"

namespace pagesweep {
namespace {

constexpr int most_squares = 200;

BoardType read_type(const JsonReader& json) {
  const auto type = value_named<BoardType>(json.text());
  if (!type) throw json.error(fmt::format("expected one of {}", fmt::join(names_of(BoardType{}), ", ")));
  return *type;
}

/// Two items of an array.
std::vector<JsonReader> read_pair(const JsonReader& json) {
  auto items = json.items();
  if (items.size() != 2) throw json.error(fmt::format("expected 2 numbers, found {}", items.size()));
  return items;
}

}  // namespace

Board read_board(const std::filesystem::path& file) {
  const JsonReader json = JsonReader::read(file);
  json.expect_format("pagesweep-board", 1);
  Board board;
  board.type = read_type(json.at("type"));
  const auto squares = read_pair(json.at("squares"));
  board.columns = squares[0].integer(2, most_squares);
  board.rows = squares[1].integer(2, most_squares);
  board.square_mm = json.at("square_mm").number();
  if (board.type == BoardType::charuco) board.dictionary = json.at("dictionary").text();
  if (const auto legacy = json.find("legacy_pattern")) board.legacy_pattern = legacy->boolean();
  if (board.type != BoardType::chessboard) board.marker_mm = json.at("marker_mm").number();
  if (const auto scale = json.find("print_scale")) {
    const auto pair = read_pair(*scale);
    board.print_scale = {pair[0].number(), pair[1].number()};
  }
  if (const std::string problem = problem_of(board); !problem.empty()) throw json.error("the board " + problem);
  return board;
}

void write_board(const std::filesystem::path& file, const Board& board) {
  nlohmann::ordered_json json = {{"format", "pagesweep-board"},
                                 {"version", 1},
                                 {"type", std::string(name_of(board.type))},
                                 {"squares", {board.columns, board.rows}},
                                 {"square_mm", board.square_mm}};
  if (board.type == BoardType::charuco) {
    json["dictionary"] = board.dictionary;
    json["legacy_pattern"] = board.legacy_pattern;
  }
  if (board.type != BoardType::chessboard) json["marker_mm"] = board.marker_mm;
  json["print_scale"] = {board.print_scale.x(), board.print_scale.y()};
  write_json(file, json);
}

}  // namespace pagesweep
