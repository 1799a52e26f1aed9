// SPDX-License-Identifier: Apache-2.0
// pagesweep board: a calibration board to print.
#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>

#include "cli/command.h"
#include "cli/option_visitor.h"
#include "pagesweep/calibration/draw_board.h"
#include "pagesweep/io/atomic_file.h"
#include "pagesweep/io/board_file.h"

namespace pagesweep::cli {
namespace {

struct Arguments {
  CommonOptions common;
  std::filesystem::path output;
  Board board;
  std::string squares = "25x18";
  std::string paper;
  std::vector<double> measured_mm;
};

void read_squares(const std::string& text, Board& board) {
  const char* end = text.data() + text.size();
  const auto columns = std::from_chars(text.data(), end, board.columns);
  const bool has_rows = columns.ec == std::errc() && columns.ptr != end && *columns.ptr == 'x';
  const auto rows = has_rows ? std::from_chars(columns.ptr + 1, end, board.rows) : columns;
  if (!has_rows || rows.ec != std::errc() || rows.ptr != end)
    throw std::invalid_argument(fmt::format("--squares: expected two numbers like 25x18, found '{}'", text));
}

std::optional<Paper> read_paper(const std::string& text) {
  if (text.empty()) return std::nullopt;
  const auto paper = paper_named(text);
  if (!paper)
    throw std::invalid_argument(
        fmt::format("--paper: '{}' is neither A0 to A6, letter, legal, tabloid nor a size in mm like 420x297", text));
  return paper;
}

/// What the printer made of the rulers, over what they were to be.
Eigen::Vector2d print_scale(const std::vector<double>& measured_mm, const BoardPrint& print) {
  if (measured_mm.empty()) return {1, 1};
  if (measured_mm.size() != 2)
    throw std::invalid_argument("--measured-mm: expected the lengths of both rulers, across and up, like 179.6,129.8");
  const Eigen::Vector2d scale(measured_mm[0] / print.ruler_x_mm, measured_mm[1] / print.ruler_y_mm);
  if (!((scale - Eigen::Vector2d::Ones()).cwiseAbs().maxCoeff() < 0.5))
    throw std::invalid_argument(
        fmt::format("--measured-mm: the rulers were to be {} mm across and {} mm up: these cannot be "
                    "their printed lengths",
                    print.ruler_x_mm, print.ruler_y_mm));
  return scale;
}

void run(Arguments& arguments) {
  read_squares(arguments.squares, arguments.board);
  const BoardPrint print = print_board(arguments.board, read_paper(arguments.paper));
  arguments.board.print_scale = print_scale(arguments.measured_mm, print);
  const auto beside = [&](const char* extension) {
    return std::filesystem::path(arguments.output).replace_extension(extension);
  };
  if (arguments.output.extension() != ".json")
    throw std::invalid_argument("-o: expected a name that ends in .json; the PDF and the SVG get the same name");
  write_bytes(beside(".pdf"), print.pdf);
  write_bytes(beside(".svg"), print.svg);
  write_board(arguments.output, arguments.board);
  print_answer(
      arguments.common,
      {{"board", arguments.output.string()},
       {"pdf", beside(".pdf").string()},
       {"svg", beside(".svg").string()},
       {"paper_mm", {print.paper.width_mm, print.paper.height_mm}},
       {"rulers_mm", {print.ruler_x_mm, print.ruler_y_mm}},
       {"corners", arguments.board.corner_count()}},
      fmt::format("{}, {}, {}: paper of {:g} mm x {:g} mm. Print at 100 %, measure the rulers ({:g} mm across, {:g} mm "
                  "up), and give their lengths with --measured-mm.\n",
                  arguments.output.string(), beside(".pdf").string(), beside(".svg").string(), print.paper.width_mm,
                  print.paper.height_mm, print.ruler_x_mm, print.ruler_y_mm));
}

void add_board_options(CLI::App& command, Arguments& arguments) {
  const std::string group = "Board";
  OptionVisitor visit(command, group);
  visit("type", arguments.board.type, "", "what is printed; of a ChArUco board a part is enough to be found");
  visit("dictionary", arguments.board.dictionary, "", "of the markers of a ChArUco board, by OpenCV's name");
  visit("squares", arguments.squares, "", "across and up; for circles: circles in a row, and rows");
  visit("square-mm", arguments.board.square_mm, "mm",
        "side of a square; for circles: distance of rows, which is half the distance within a row");
  visit("marker-mm", arguments.board.marker_mm, "mm", "side of a marker; for circles: their diameter");
  visit("legacy-pattern", arguments.board.legacy_pattern, "",
        "a ChArUco board with an even number of rows has a white square at the upper left, as with OpenCV before 4.6");
  visit("paper", arguments.paper, "",
        "A0 to A6, letter, legal, tabloid or a size in mm like 420x297; left out: as large as the board needs");
  command.add_option("--measured-mm", arguments.measured_mm)
      ->group(group)
      ->option_text("<mm>,<mm>")
      ->delimiter(',')
      ->description("the printed rulers' lengths, across and up; corrects the definition, not the drawing");
}

}  // namespace

void add_board_command(CLI::App& app) {
  auto* command = app.add_subcommand("board", R"(Make a calibration board to print.

Writes the board's definition, which `pagesweep calibrate` needs, and beside it the board
itself as PDF and SVG, true to scale, with a ruler along each side. Printers are off by up to
a percent: measure both rulers and run the command again with --measured-mm.
)");
  const auto arguments = std::make_shared<Arguments>();
  add_board_options(*command, *arguments);
  command->add_option("-o,--output", arguments->output, "the definition to write, NAME.json")
      ->required()
      ->option_text("<file>");
  add_common_options(*command, arguments->common);
  command->footer(R"(Examples:
  pagesweep board --paper A3 --square-mm 14 --marker-mm 10.5 -o board.json
  pagesweep board --squares 25x18 --square-mm 7.5 --marker-mm 5.6 --paper A4 -o board.json
  pagesweep board --squares 25x18 --square-mm 7.5 --marker-mm 5.6 --paper A4 \
                  --measured-mm 179.6,129.9 -o board.json
  pagesweep board --type chessboard --squares 12x9 --square-mm 20 -o chessboard.json
)");
  command->callback([arguments] { run(*arguments); });
}

}  // namespace pagesweep::cli
