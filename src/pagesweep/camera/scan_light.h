// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <vector>

#include "pagesweep/camera/light.h"
#include "pagesweep/data/picture.h"

namespace pagesweep {

/// The lamp that sends out the sheet of light: a bar along the stripe. Under a translating sheet it travels along, at a
/// fixed height; about a rotating one it is the axis.
struct LampBar {
  double height_mm = 600;  ///< above the table, z of the rig
  double length_mm = 560;
  double center_mm = 0;  ///< of the bar's middle along the stripe, from the rig's origin
};

/// What the scanner makes of an evenly white sheet: linear light on a grid that spans the scan, node (0, 0) on its
/// first pixel and the last node on its last one.
struct WhiteReference {
  double height_mm = 0;  ///< z of that sheet
  int columns = 0, rows = 0;
  std::vector<std::array<float, 3>> light;  ///< row by row; red, green, blue, or three times gray

  /// Bilinear. \param u, v  share of the scan's width and height, 0 to 1
  std::array<double, 3> at(double u, double v) const;
};

/// The white reference in the scan of a blank sheet that covers all of it: the median of each cell around a node.
/// \throws Error bad_input  if the sheet is overexposed, dark, or not blank: its light varies within a cell
WhiteReference measure_white(const Picture& sheet, double height_mm = 0, int columns = 24, int rows = 18);

}  // namespace pagesweep
