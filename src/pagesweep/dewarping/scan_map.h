// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/data/page.h"
#include "pagesweep/dewarping/page_frame.h"
#include "pagesweep/dewarping/paper_view.h"

namespace pagesweep {

/// Where each pixel of a flat page is imaged in the scan.
///
/// The surface and the scanner are evaluated on a lattice of some pixels' pitch and interpolated by bicubic splines
/// (Catmull-Rom); cells in which that is off by more than the tolerance, or which are partly hidden, are evaluated
/// pixel by pixel. Pixels beyond the gutter, outside the scan or behind other paper are NaN.
///
/// \param view           the page as the scanner sees it; its shape decides whether eq. 12 is applied
/// \param tolerance_px   error of the interpolation [scan px], checked in the middle of each lattice cell
/// \return frame.width_px(pixels_per_mm) x frame.height_px(pixels_per_mm) positions
/// \throws std::invalid_argument  if pixels_per_mm or tolerance_px is not positive
ScanMap build_scan_map(const PaperView& view, const Occlusion& occlusion, const PageFrame& frame, double pixels_per_mm,
                       double tolerance_px = 0.02);

/// Scan pixels per millimetre of paper: the geometric mean over both directions, the median over the page.
/// \throws Error no_result  if the scan shows no part of the page
double scan_pixels_per_mm(const PaperView& view, const PageFrame& frame);

}  // namespace pagesweep
