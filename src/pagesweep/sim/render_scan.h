// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>

#include "pagesweep/base/progress.h"
#include "pagesweep/camera/scanner.h"
#include "pagesweep/data/page.h"
#include "pagesweep/data/picture.h"
#include "pagesweep/sim/render_camera.h"

namespace pagesweep::sim {

struct ScanOptions {
  int rays_per_side = 3;                             ///< a pixel is sampled with the square of it
  int bit_depth = 8;                                 ///< 8 or 16
  std::array<double, 3> tint = {1.0, 0.985, 0.945};  ///< of the paper: red, green, blue
  double noise = 0.002;                              ///< one standard deviation at full light, which has the value 1
};

/// Renders the scanner's picture: sRGB, white being an albedo of 1 on the table. The lamp travels with the line, so
/// every pixel is lit by the stripe's middle, and by the glow of that moment; brightness is evened out to that of the
/// bare table, as a scanner does with its white reference. There is no gloss: the lamps of such scanners are set so.
Picture render_scan(const LitWorld& lit, const Lamp& lamp, const Scanner& scanner, const ScanOptions& options,
                    std::uint64_t seed, Progress& progress = no_progress());

/// For each pixel of a page's flat picture the place in the scan; NaN where hidden.
/// \param surface  number of the page's surface in the world
ScanMap find_scan_map(const World& world, const RayCaster& caster, int surface, const Scanner& scanner, int width,
                      int height, double pixels_per_mm);

/// sRGB's encoding (IEC 61966-2-1) of a linear value; both from 0 to 1.
double encode_srgb(double linear);

}  // namespace pagesweep::sim
