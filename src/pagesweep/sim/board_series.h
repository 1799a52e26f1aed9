// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <string_view>

#include "pagesweep/base/enum_names.h"
#include "pagesweep/base/progress.h"
#include "pagesweep/camera/rig.h"
#include "pagesweep/camera/scanner_model.h"
#include "pagesweep/data/board.h"
#include "pagesweep/sim/render_board.h"

namespace pagesweep::sim {

enum class SeriesScanner { none, brown_conrady, pushbroom, rotating_line };
constexpr auto names_of(SeriesScanner) {
  return std::array<std::string_view, 4>{"none", "brown-conrady", "pushbroom", "rotating-line"};
}

struct BoardSeriesOptions {
  int poses = 20;
  double highest_mm = 60;
  SeriesScanner scanner = SeriesScanner::pushbroom;
  double scan_dpi = 150;
  double bend_mm = 0;
  double blur_px = 0.6;
  double exposure = 0.7;

  template <class Visitor>
  void describe(Visitor&& visit) {
    visit("poses", poses, "", "in how many poses the board is seen; it lies on the table in the first one");
    visit("highest-mm", highest_mm, "mm", "height above the table that the board's lower edge is held at, at most");
    visit("scanner", scanner, "", "how the simulated scanner maps space");
    visit("scan-dpi", scan_dpi, "dpi", "resolution of its pictures");
    visit("bend-mm", bend_mm, "mm", "by how much the middle of the board stands above its left and right side");
    visit("blur-px", blur_px, "px", "standard deviation of the lenses' point spread");
    visit("exposure", exposure, "", "share of the full well that the board's white fills in the middle of a picture");
  }
};

/// A scanner over an A3 table that is not quite where it was meant to be, as real ones are not.
Scanner make_skewed_scanner(ScannerModel model, double dpi);

/// Renders a board in many poses as all cameras of a rig and the scanner of the options see it. Writes folder /
/// CAMERA/NN.png, scanner/NN.png, board.json and, for judges only, truth/rig.json.
/// \throws Error  if it cannot be written
void write_board_series(const Rig& rig, const Board& board, const BoardDrawing& drawing,
                        const BoardSeriesOptions& options, const SensorModel& sensor, int seed,
                        const std::filesystem::path& folder, Progress& progress = no_progress());

}  // namespace pagesweep::sim
