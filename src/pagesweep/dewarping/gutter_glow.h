// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "pagesweep/data/picture.h"
#include "pagesweep/dewarping/lamp_light.h"
#include "pagesweep/dewarping/paper_view.h"

namespace pagesweep {

/// Irradiance by channel: red, green, blue, or three times gray.
using ChannelLight = std::array<double, 3>;

/// The part of an infinite strip's light that its lit stretch sends: the strip is `distance_mm` away, and its light
/// falls off from the spot's own height as a Gaussian of standard deviation `sigma_mm`. From 1 beside it to 0 far away.
double lit_share(double distance_mm, double sigma_mm);

/// The light that a page receives by way of the page across the gutter, while the stripe passes.
///
/// Seen from a spot, the facing page's cut through the sheet of light is a row of strips along the spine. A strip from
/// angle p1 to angle p2 against the spot's normal gives (sin p2 - sin p1) / 2 of what it sends out (Hottel), times the
/// share of it that is lit. What a strip sends out is in the scan itself: print, colour and all further reflections
/// included. Paper nearer to the gutter hides what is lower behind it.
class GutterGlow {
 public:
  /// \param page, facing  two pages that meet at the gutter
  GutterGlow(const PaperView& page, const PaperView& facing, const Picture& scan, const ScanLight& light);

  /// Relative to the light that falls on level paper there. Zero where the spine does not run across the sheet of
  /// light.
  ChannelLight at(const Eigen::Vector2d& paper_mm, const Eigen::Vector3d& point_mm,
                  const Eigen::Vector3d& normal) const;

 private:
  double share_at(double distance_mm) const;
  int row_beside(const PaperView& view, const Eigen::Vector3d& point, const Eigen::Vector3d& sheet_normal) const;

  const PaperView& page_;
  const PaperView& facing_;
  LampLight lamp_;
  std::vector<double> lit_shares_;    ///< by distance
  Image<std::array<float, 3>> sent_;  ///< by each node of the facing page
};

}  // namespace pagesweep
