// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string_view>

#include "pagesweep/base/enum_names.h"
#include "pagesweep/data/page.h"
#include "pagesweep/data/picture.h"

namespace pagesweep {

/// The interpolation kernel: what is between the scan's pixels. docs/derivations/dewarping.md compares them.
enum class ResampleKernel {
  catmull_rom,  ///< cubic, 4 taps, interpolating
  mitchell,     ///< cubic, 4 taps, smoothing (Mitchell and Netravali 1988, B = C = 1/3)
  lanczos3,     ///< windowed sinc, 6 taps, the sharpest
};

constexpr auto names_of(ResampleKernel) {
  return std::array<std::string_view, 3>{"catmull-rom", "mitchell", "lanczos3"};
}

struct ResampleOptions {
  ResampleKernel kernel = ResampleKernel::lanczos3;
  double fill = 1;  ///< of hidden pixels: 0 black, 1 white

  template <class Visitor>
  void describe(Visitor&& visit) {
    visit("kernel", kernel, "", "interpolation of the scan: catmull-rom, mitchell or lanczos3");
    visit("fill", fill, "share of white", "brightness of pixels that the scan does not show");
  }
};

/// The scan, looked up at every position of the map: page pixel (x, y) = scan(map.u(x, y), map.v(x, y)).
///
/// The kernel is a product of one along u and one along v. Where the map makes the picture smaller, that is where the
/// scan position moves by more than a pixel from one page pixel to the next, the kernel is widened by that factor,
/// separately along u and v and up to 32, and so removes what the page's pixels could not carry. Weights sum to 1;
/// positions near the scan's border see its outermost pixels repeated. Overshoot is clipped to the range of the
/// samples.
///
/// \param pixels_per_mm  of the page, recorded in the result
/// \return as many channels and bits as the scan, with its colour profile and metadata; `fill` where the map is NaN or
/// outside the scan
Picture resample(const Picture& scan, const ScanMap& map, double pixels_per_mm, const ResampleOptions& options = {});

/// The same without tables, vectors and threads, weights computed anew for every pixel: the reference in tests.
Picture resample_plainly(const Picture& scan, const ScanMap& map, double pixels_per_mm,
                         const ResampleOptions& options = {});

}  // namespace pagesweep
