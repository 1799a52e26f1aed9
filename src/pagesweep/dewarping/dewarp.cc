// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/dewarping/dewarp.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>

#include "pagesweep/base/parallel.h"
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

/// One resolution for all pages: the one asked for, the scan's own, or, of a scan that knows none, the finest at which
/// it shows a page, in whole dpi.
double choose_pixels_per_mm(std::span<const PaperView> views, std::span<const PageOutline> outlines,
                            const Picture& scan, const DewarpOptions& options) {
  if (options.dpi > 0) return options.dpi / mm_per_inch;
  if (scan.pixels_per_mm > 0) return scan.pixels_per_mm;
  double finest = 0;
  for (std::size_t k = 0; k < views.size(); ++k)
    finest = std::max(finest, scan_pixels_per_mm(views[k], outlines[k].frame));
  return std::max(1.0, std::round(finest * mm_per_inch)) / mm_per_inch;
}

void warn_of_missing_edges(const PageOutline& outline, int index, Progress& progress) {
  for (const PageSide side : {PageSide::left, PageSide::right, PageSide::top, PageSide::bottom})
    if (outline.sides[static_cast<std::size_t>(side)] == OutlineEvidence::measured_extent)
      progress.warn(
          fmt::format("page {}: the paper's {} edge is not seen against a darker table; the page ends where "
                      "the measured surface does",
                      index, name_of(side)));
}

Page make_page(const PaperView& view, const Occlusion& occlusion, const PageOutline& outline, double pixels_per_mm,
               const Picture& scan, const ResampleOptions& resampling) {
  Page page;
  page.index = view.surface().index;
  page.scan_map = build_scan_map(view, occlusion, outline.frame, pixels_per_mm);
  page.picture = resample(scan, page.scan_map, pixels_per_mm, resampling);
  page.deskew_rad = view.surface().turned_rad + outline.frame.angle_rad;
  page.measured_share = measured_share(view.surface(), outline.frame);
  return page;
}

/// Paints over what is not the page's own paper.
void cover(const PaperView& view, const PageFrame& frame, const Picture& scan, const DewarpOptions& options,
           Page& page) {
  if (options.obstructions != Obstructions::keep) {
    const Image<char> mask = find_obstructions(view.surface(), frame, page.picture);
    if (!mask.empty() && options.obstructions == Obstructions::fill)
      cover_with_paper(mask, page);
    else if (!mask.empty())
      cover_with(mask, options.resampling.fill, page);
  }
  if (options.surroundings == Surroundings::mask)
    if (const Image<char> mask = find_surroundings(view, scan, frame, page); !mask.empty())
      cover_with(mask, options.resampling.fill, page);
}

}  // namespace

std::vector<Page> dewarp(std::span<const PageSurface> surfaces, const Picture& scan, const Scanner& scanner,
                         const DewarpOptions& options, Progress& progress, const ScanLight& light) {
  check(scan, scanner, options);
  progress.begin("flat pages");
  const PaperShape shape = options.difference_vector ? PaperShape::measured : PaperShape::model;
  std::vector<PaperView> views;
  for (const PageSurface& surface : surfaces) views.emplace_back(surface, scanner, shape);
  std::vector<PageOutline> outlines(views.size());
  parallel_rows(static_cast<int>(views.size()), [&](int k) {
    const auto n = static_cast<std::size_t>(k);
    outlines[n] = find_page_outline(views[n], scan, {options.deskew, options.crop, options.margin_mm});
  });
  for (std::size_t k = 0; k < views.size(); ++k) warn_of_missing_edges(outlines[k], surfaces[k].index, progress);
  const double pixels_per_mm = choose_pixels_per_mm(views, outlines, scan, options);
  const Occlusion occlusion(views);
  std::optional<PageLight> page_light;
  if (options.shading == Shading::even) page_light.emplace(views, scan, light);
  std::vector<Page> pages(views.size());
  parallel_rows(static_cast<int>(views.size()), [&](int k) {
    const auto n = static_cast<std::size_t>(k);
    pages[n] = make_page(views[n], occlusion, outlines[n], pixels_per_mm, scan, options.resampling);
    if (page_light) apply_gain(page_light->gain(n, outlines[n].frame), pages[n]);
    cover(views[n], outlines[n].frame, scan, options, pages[n]);
  });
  progress.advance(1);
  return pages;
}

}  // namespace pagesweep
