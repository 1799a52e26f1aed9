// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "pagesweep/base/image.h"
#include "pagesweep/data/page.h"
#include "pagesweep/data/page_surface.h"
#include "pagesweep/data/picture.h"
#include "pagesweep/data/point_map.h"
#include "pagesweep/report/colour_ramp.h"

namespace pagesweep {

/// The values that a ramp's two ends stand for.
struct Range {
  double low = 0;
  double high = 1;
};

/// From the value that `tail` of all values undercut to the one that as many exceed; {0, 1} if there are none.
Range range_of(const Image<float>& values, double tail = 0.01);

/// The same, but even about 0 for deviations.
Range symmetric_range_of(const Image<float>& values, double tail = 0.01);

/// 1, 2 or 5 times a power of ten, so that about `lines` contours cross the range.
double round_step(Range range, int lines);

/// A map in colours: RGB, 8 bit, one pixel a value.
Picture draw_map(const Image<float>& values, Ramp ramp, Range range);

/// Likewise, with a dark line wherever the values pass a multiple of `step`.
Picture draw_contours(const Image<float>& values, Ramp ramp, Range range, double step);

/// Why pixels are missing, in the colours of colour_of(PixelStatus).
Picture draw_status(const Image<PixelStatus>& status);

/// Height over a plan.
struct HeightField {
  Image<float> height;       ///< [mm] towards the viewer, NaN where nothing was measured
  double mm_per_px = 1;      ///< of the plan
  bool z_is_towards = true;  ///< height is z of the rig; otherwise -z, where cameras look along +z
};

/// All cameras' points seen at right angles to the rig's xy plane, from the cameras' side: x to the right, the plan as
/// large as its points and no finer than they are. A cell has the mean of its points; single empty cells between
/// full ones take their neighbours' mean, for the eye only.
/// \param longest_px  of the plan's sides
HeightField make_height_field(std::span<const PointMap> cameras, int longest_px);
HeightField make_height_field(std::span<const PointMap* const> cameras, int longest_px);

/// The surface as matt plaster, lit from the upper left (Lambert), in the colours of its height.
Picture draw_relief(const HeightField& field, Range height_mm);

/// How far the measured surface lies above the model that goes with it [mm], along the model's normal and positive on
/// the side that the normal of a page seen from above has; NaN where nothing was measured. One value a node.
Image<float> difference_of(const PageSurface& surface);

/// Smaller by a whole factor so that no side is longer than `longest_px`: means of the values that are there.
Image<float> shrink(const Image<float>& values, int longest_px);
/// Likewise; one pixel of each block.
Image<PixelStatus> shrink(const Image<PixelStatus>& status, int longest_px);
/// Likewise, 8 bit. Keeps a colour profile, leaves other metadata behind.
Picture shrink(const Picture& picture, int longest_px);

/// The part of the scan that pages were taken from, as it is in the scan; empty if they were taken from nowhere.
Picture crop_to_pages(const Picture& scan, std::span<const Page> pages);

}  // namespace pagesweep
