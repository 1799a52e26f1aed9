// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "pagesweep/base/enum_names.h"
#include "pagesweep/data/figure.h"
#include "pagesweep/data/page.h"
#include "pagesweep/data/page_surface.h"
#include "pagesweep/data/picture.h"
#include "pagesweep/dewarping/resample.h"
#include "pagesweep/quality/edge_mtf.h"
#include "pagesweep/quality/effective_resolution.h"
#include "pagesweep/quality/paper_look.h"

namespace pagesweep {

/// What is to be done about a page.
enum class PageVerdict {
  good,        ///< nothing
  look,        ///< usable, but something deserves a look
  scan_again,  ///< not usable as it is
};
constexpr auto names_of(PageVerdict) { return std::array<std::string_view, 3>{"good", "look", "scan_again"}; }

/// Limits of the verdict. The lower of each pair deserves a look, the other one another scan.
struct QualityOptions {
  double look_efficiency = 60, bad_efficiency = 35;
  double look_resolution = 190, bad_resolution = 100;
  double look_noise = 4, bad_noise = 10;
  double look_uniformity = 8, bad_uniformity = 40;
  double look_clipped = 2, bad_clipped = 30;
  double look_scale = 1, bad_scale = 5;
  double look_covered = 0.01, bad_covered = 8;
  double look_measured = 95, bad_measured = 70;
  double look_unseen = 1, bad_unseen = 10;

  template <class Visitor>
  void describe(Visitor&& visit) {
    const auto pair = [&](const char* look, double& a, const char* bad, double& b, const char* unit, const char* what) {
      visit(look, a, unit, std::string(what) + ": beyond, a page deserves a look");
      visit(bad, b, unit, std::string(what) + ": beyond, it is to be scanned again");
    };
    pair("look-efficiency", look_efficiency, "bad-efficiency", bad_efficiency, "%", "sampling efficiency");
    pair("look-resolution", look_resolution, "bad-resolution", bad_resolution, "dpi", "resolution of the scan");
    pair("look-noise", look_noise, "bad-noise", bad_noise, "L*", "noise");
    pair("look-uniformity", look_uniformity, "bad-uniformity", bad_uniformity, "%", "non-uniformity of the paper");
    pair("look-clipped", look_clipped, "bad-clipped", bad_clipped, "%", "share of clipped pixels");
    pair("look-scale", look_scale, "bad-scale", bad_scale, "%", "scale error");
    pair("look-covered", look_covered, "bad-covered", bad_covered, "%", "share covered by something");
    pair("look-measured", look_measured, "bad-measured", bad_measured, "%", "share that rests on measured points");
    pair("look-unseen", look_unseen, "bad-unseen", bad_unseen, "%", "share that the scan does not show");
  }
};

/// One quantity with the level that it reaches; empty levels: neither document has a limit for it.
struct QualityFigure {
  Figure figure;
  std::string fadgi;  ///< "4 stars", ...
  std::string iso;    ///< "A", ...
};

/// What is known of a page's quality without a target in the picture (docs/quality.md).
struct PageQuality {
  int index = 1;
  std::vector<QualityFigure> figures;
  ResolutionMap resolution;
  PaperLook paper;
  std::array<EdgeSharpness, 2> sharpness;  ///< along x and y
  PageVerdict verdict = PageVerdict::good;
  std::vector<std::string> reasons;  ///< why it is not good, worst first

  /// The figure of that name; NaN if it is missing.
  double value(std::string_view name) const;
};

/// \param kernel  that the page was resampled with
PageQuality measure_quality(const Page& page, const PageSurface& surface, const PictureLight& scan,
                            ResampleKernel kernel, const QualityOptions& options = {});

/// All pages of a scan.
std::vector<PageQuality> measure_quality(std::span<const Page> pages, std::span<const PageSurface> surfaces,
                                         const Picture& scan, ResampleKernel kernel,
                                         const QualityOptions& options = {});

}  // namespace pagesweep
