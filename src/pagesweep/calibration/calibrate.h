// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "pagesweep/base/enum_names.h"
#include "pagesweep/base/progress.h"
#include "pagesweep/calibration/bundle.h"
#include "pagesweep/calibration/detect_board.h"
#include "pagesweep/calibration/start_values.h"
#include "pagesweep/camera/rig.h"

namespace pagesweep {

enum class ScannerModelChoice { auto_, brown_conrady, pushbroom, rotating_line };
constexpr auto names_of(ScannerModelChoice) {
  return std::array<std::string_view, 4>{"auto", "brown-conrady", "pushbroom", "rotating-line"};
}

struct CalibrationOptions {
  ScannerModelChoice scanner_model = ScannerModelChoice::auto_;
  LensModel lens = LensModel::full;
  bool fit_bend = false;
  bool fit_stretch = false;
  bool cross_validate = false;
  double outlier_sigmas = 5;
  std::string table_pose = {};
  double board_thickness_mm = 0;

  template <class Visitor>
  void describe(Visitor&& visit) {
    visit("scanner-model", scanner_model, "", "how the scanner maps space; auto: what predicts pictures left out best");
    visit("lens", lens, "", "which distortion parameters of the cameras are estimated");
    visit("fit-bend", fit_bend, "", "estimate how the board is bent, for boards that are not on glass or aluminium");
    visit("fit-stretch", fit_stretch, "", "estimate how much longer the board was printed along y than along x");
    visit("cross-validate", cross_validate, "", "leave out each pose in turn and tell how well it is predicted");
    visit("outlier-sigmas", outlier_sigmas, "", "a corner farther off, in standard deviations, is left out and listed");
    visit("table-pose", table_pose, "",
          "name of the pictures that show the board lying on the table; empty: the first");
    visit("board-thickness-mm", board_thickness_mm, "mm", "of the board, by which the table lies below its print");
  }
};

/// A picture that was searched for the board.
struct BoardPicture {
  int pose = 0;  ///< index of CalibrationInput::poses
  std::string file;
  BoardView view;
};

/// All pictures of one camera, or of the scanner.
struct SensorPictures {
  std::string name;
  int width = 0, height = 0;  ///< [px]
  bool is_scanner = false;    ///< at most one, the last
  std::vector<BoardPicture> pictures;
};

/// What a calibration is made from. Pictures of different sensors with the same pose show the board in the same place.
struct CalibrationInput {
  Board board;
  std::vector<std::string> poses;  ///< names
  std::vector<SensorPictures> sensors;
  /// In which direction over the board the light moves, of poses in which that was seen.
  struct LightDirection {
    int pose = 0;
    Eigen::Vector2d on_board;  ///< unit length, board frame
  };
  std::vector<LightDirection> light_directions = {};
};

/// How well one model of the scanner predicts pictures that it was not fitted to.
struct ScannerTrial {
  ScannerModel model = ScannerModel::pushbroom;
  double rms_px = 0;  ///< on the poses left out; NaN: it could not be fitted
  bool chosen = false;
};

/// A finished calibration.
struct Calibration {
  Rig rig;
  Bundle bundle;                     ///< with every observation, outliers included
  BundleSolution solution;           ///< in the rig frame
  int table_pose = 0;                ///< index of the pose that lies on the table
  std::vector<ScannerTrial> trials;  ///< if the scanner's model was to be chosen
  std::vector<double> left_out_px;  ///< a pose each: rms [px] when it was left out; empty: not asked for, NaN: not seen
  std::vector<std::string> warnings;  ///< pictures and poses that were left out, and why
};

/// Calibrates cameras and scanner from pictures of a board (docs/derivations/calibration.md): closed-form start values,
/// then one least-squares adjustment of everything.
///
/// Rig frame: z = 0 is the table and z points to the cameras; the origin is below the middle of the board in the table
/// pose. y is the direction in which the light moves, if that is known; else with a scanner the direction in which its
/// rows count; without, the axis of the board that comes closest
/// to the line from the first camera to the second one; with one camera, the one closest to its rows, downwards.
///
/// \throws Error                  if the pictures cannot give a calibration; the message names the cause
/// \throws std::invalid_argument  if an option cannot be meant
Calibration calibrate(const CalibrationInput& input, const CalibrationOptions& options,
                      Progress& progress = no_progress());

}  // namespace pagesweep
