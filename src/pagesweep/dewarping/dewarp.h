// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "pagesweep/base/progress.h"
#include "pagesweep/camera/scanner.h"
#include "pagesweep/data/page.h"
#include "pagesweep/data/page_surface.h"
#include "pagesweep/data/picture.h"
#include "pagesweep/dewarping/even_light.h"
#include "pagesweep/dewarping/paper_mask.h"
#include "pagesweep/dewarping/resample.h"

namespace pagesweep {

struct DewarpOptions {
  double dpi = 0;
  bool difference_vector = true;
  bool deskew = true;
  bool crop = true;
  double margin_mm = 0;
  Surroundings surroundings = Surroundings::keep;
  Obstructions obstructions = Obstructions::keep;
  Shading shading = Shading::even;
  ResampleOptions resampling{};

  template <class Visitor>
  void describe(Visitor&& visit) {
    visit("dpi", dpi, "pixels per inch", "resolution of the pages; 0: that of the scan, from its file or its geometry");
    visit("difference-vector", difference_vector, "",
          "correct the surface model by the measured deviations from it (eq. 12)");
    visit("deskew", deskew, "", "turn the page upright by its edges or its text lines");
    visit("crop", crop, "", "cut the page at the paper's edge");
    visit("margin", margin_mm, "mm", "keep that much of the table around a cropped page; negative: cut off more");
    visit("surroundings", surroundings, "",
          "mask: paint over the table beside crooked edges and in torn corners; keep: leave it");
    visit("obstructions", obstructions, "",
          "fingers, clips, slips of paper: leave them, paint over them, or fill them with paper colour");
    visit("shading", shading, "",
          "even: divide out what slope, distance and the facing page do to the light; keep: leave it");
    resampling.describe(visit);
  }
};

/// Flattens the pages: for each surface the paper's outline, where each pixel of the flat page lies in the scan, and
/// the scan resampled there (Lilienblum et al. 2009, section IV). Pages are true to scale and oriented as their (s, t)
/// are. What the scan does not show is white in the picture and NaN in the scan map. A page's deskew_rad is the angle
/// from s towards t by which its rightward direction was turned back: clockwise on the page is positive.
///
/// \param surfaces  all pages of the scan, since one may hide part of another
/// \param light     what is known of the light, for options.shading
/// \throws std::invalid_argument  if the scan is not of the scanner's size, or an option is out of range
/// \throws Error no_result        if the scan shows nothing of a page
std::vector<Page> dewarp(std::span<const PageSurface> surfaces, const Picture& scan, const Scanner& scanner,
                         const DewarpOptions& options = {}, Progress& progress = no_progress(),
                         const ScanLight& light = {});

}  // namespace pagesweep
