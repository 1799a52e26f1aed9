// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "pagesweep/base/image.h"
#include "pagesweep/camera/scanner.h"
#include "pagesweep/data/board.h"
#include "pagesweep/sim/sensor.h"

namespace pagesweep::sim {

/// How pictures of a calibration board are rendered.
struct BoardRenderOptions {
  int rays_per_side = 8;                            ///< a pixel is sampled with the square of it
  double psf_sigma_px = 0.6;                        ///< the lens' Gaussian point spread, on top of the pixel's own area
  double exposure = 0.7;                            ///< share of the full well that white paper at the middle fills
  double falloff = 0.25;                            ///< by which the light is weaker towards a picture's corners
  double white = 0.85, black = 0.06, table = 0.04;  ///< albedos
  double border_mm = 8;                             ///< of white paper around the pattern
  double texels_per_mm = 12;
  SensorModel sensor;
};

/// A board where it lies: rig point = rig_from_board * (x, y, bend(x, y)).
struct PlacedBoard {
  const BoardDrawing* drawing = nullptr;
  Eigen::Vector2d print_scale = {1, 1};
  Rigid3 rig_from_board;
  std::function<double(double x_mm, double y_mm)> bend_mm = {};  ///< empty: flat
};

/// What a camera or the scanner sees of a board over the dark table at z = 0 under even light; 8 bit.
Image<std::uint8_t> render_board(const PlacedBoard& board, const Scanner& sensor, const BoardRenderOptions& options,
                                 std::uint64_t seed);

/// Poses as a careful person lays a board into a scanner whose table's middle is (0, 0, 0): the first flat on the
/// table, then turned by up to 30 degrees, tilted by 8 to 30 in changing directions, at changing places and heights up
/// to `highest_mm`. Its lowest end does not sink into the table.
/// \param size_mm   of the board
/// \param table_mm  over whose extent the board's middle is moved
std::vector<Rigid3> board_poses(const Eigen::Vector2d& size_mm, const Eigen::Vector2d& table_mm, double highest_mm,
                                int count, std::uint64_t seed);

}  // namespace pagesweep::sim
