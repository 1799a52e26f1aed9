// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/base/image.h"
#include "pagesweep/data/picture.h"
#include "pagesweep/dewarping/paper_view.h"

namespace pagesweep {

/// Brightness of the scan at a position [px], bilinear, mean of the channels, 0 black to 1 white; NaN outside.
double brightness_at(const Picture& scan, const Eigen::Vector2d& pixel);

/// A small flat picture of a surface and its surroundings, in the surface's own (s, t): where the outline is sought.
/// Pixel (x, y) shows the paper at s0 + x pitch, t0 + y pitch.
struct FlatPreview {
  double pitch_mm = 0.5;
  double s0_mm = 0, t0_mm = 0;
  Image<float> brightness;  ///< 0 to 1; NaN where the scan shows nothing
  Image<char> measured;     ///< whether the surface was measured there and the scan shows it

  int width() const { return brightness.width(); }
  int height() const { return brightness.height(); }
  double s_of(double x) const { return s0_mm + x * pitch_mm; }
  double t_of(double y) const { return t0_mm + y * pitch_mm; }
};

/// \param reach_mm  how far to look beyond the grid, except at the gutter
FlatPreview make_flat_preview(const PaperView& view, const Picture& scan, double reach_mm);

/// Fills dark spots narrower than 2 radius + 1 pixels, such as text: a maximum filter, then a minimum filter over
/// squares. NaN counts as black.
Image<float> close_dark_spots(const Image<float>& brightness, int radius);

}  // namespace pagesweep
