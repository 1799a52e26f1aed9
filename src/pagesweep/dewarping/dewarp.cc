// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/dewarping/dewarp.h"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

#include "pagesweep/dewarping/page_outline.h"
#include "pagesweep/dewarping/paper_view.h"
#include "pagesweep/dewarping/scan_map.h"

namespace pagesweep {
namespace {

constexpr double mm_per_inch = 25.4;

void check(const Picture& scan, const Scanner& scanner, const DewarpOptions& options) {
  if (scan.width() != scanner.width() || scan.height() != scanner.height())
    throw std::invalid_argument(fmt::format("dewarp: the scan is {} x {} pixels, the rig's scanner makes {} x {}",
                                            scan.width(), scan.height(), scanner.width(), scanner.height()));
  if (!(options.dpi == 0 || (options.dpi >= 10 && options.dpi <= 4800)))
    throw std::invalid_argument(fmt::format("dewarp: dpi is {}, but must be 0 or from 10 to 4800", options.dpi));
  if (!(std::abs(options.margin_mm) <= 1000))
    throw std::invalid_argument(
        fmt::format("dewarp: margin is {} mm, but must be from -1000 to 1000", options.margin_mm));
}

/// Share of the surface's nodes on the page that were measured.
double measured_share(const PageSurface& surface, const PageFrame& frame) {
  double nodes = 0, measured = 0;
  for (int j = 0; j < surface.rows(); ++j)
    for (int i = 0; i < surface.columns(); ++i) {
      if (!frame.contains({surface.s_of(i), surface.t_of(j)})) continue;
      ++nodes;
      measured += surface.status(i, j) == PixelStatus::ok;
    }
  return nodes > 0 ? measured / nodes : 0;
}

double choose_pixels_per_mm(const PaperView& view, const PageFrame& frame, const Picture& scan,
                            const DewarpOptions& options) {
  if (options.dpi > 0) return options.dpi / mm_per_inch;
  return scan.pixels_per_mm > 0 ? scan.pixels_per_mm : scan_pixels_per_mm(view, frame);
}

void warn_of_missing_edges(const PageOutline& outline, int index, Progress& progress) {
  for (const PageSide side : {PageSide::left, PageSide::right, PageSide::top, PageSide::bottom})
    if (outline.sides[static_cast<std::size_t>(side)] == OutlineEvidence::measured_extent)
      progress.warn(
          fmt::format("page {}: the paper's {} edge is not seen against a darker table; the page ends where "
                      "the measured surface does",
                      index, name_of(side)));
}

Page dewarp_page(const PaperView& view, const Occlusion& occlusion, const Picture& scan, const DewarpOptions& options,
                 Progress& progress) {
  const PageSurface& surface = view.surface();
  const PageOutline outline = find_page_outline(view, scan, {options.deskew, options.crop, options.margin_mm});
  warn_of_missing_edges(outline, surface.index, progress);
  const double pixels_per_mm = choose_pixels_per_mm(view, outline.frame, scan, options);
  Page page;
  page.index = surface.index;
  page.scan_map = build_scan_map(view, occlusion, outline.frame, pixels_per_mm);
  page.picture = resample(scan, page.scan_map, pixels_per_mm, options.resampling);
  page.deskew_rad = outline.frame.angle_rad;
  page.measured_share = measured_share(surface, outline.frame);
  return page;
}

}  // namespace

std::vector<Page> dewarp(std::span<const PageSurface> surfaces, const Picture& scan, const Scanner& scanner,
                         const DewarpOptions& options, Progress& progress) {
  check(scan, scanner, options);
  progress.begin("flat pages");
  const PaperShape shape = options.difference_vector ? PaperShape::measured : PaperShape::model;
  std::vector<PaperView> views;
  for (const PageSurface& surface : surfaces) views.emplace_back(surface, scanner, shape);
  const Occlusion occlusion(views);
  std::vector<Page> pages;
  for (const PaperView& view : views) {
    pages.push_back(dewarp_page(view, occlusion, scan, options, progress));
    progress.advance(double(pages.size()) / double(views.size()));
  }
  return pages;
}

}  // namespace pagesweep
