// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/quality/page_quality.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "pagesweep/dewarping/kernel_mtf.h"
#include "pagesweep/quality/line_straightness.h"
#include "pagesweep/quality/standards.h"

namespace pagesweep {
namespace {

constexpr double nyquist = 0.5;  // [cycles a pixel]

/// Collects the figures of a page.
class Figures {
 public:
  explicit Figures(PageQuality& quality) : quality_(quality), group_(fmt::format("page_{}", quality.index)) {}
  void add(const char* name, const std::string& what, double value, const char* unit, const char* reason = "") {
    Figure figure{group_, name, what, value, unit, std::isnan(value) ? reason : ""};
    quality_.figures.push_back({figure, fadgi_level(name, value), iso_level(name, value)});
  }

 private:
  PageQuality& quality_;
  std::string group_;
};

/// How much longer the measured surface is than the paper that it is said to be, mean over the page, in percent: what
/// laying flat did to the scale.
double scale_error(const PageSurface& surface, bool across) {
  double sum = 0, count = 0;
  const int di = across ? 1 : 0, dj = across ? 0 : 1;
  for (int j = 0; j + dj < surface.rows(); ++j)
    for (int i = 0; i + di < surface.columns(); ++i) {
      if (surface.status(i, j) != PixelStatus::ok || surface.status(i + di, j + dj) != PixelStatus::ok) continue;
      sum += double((surface.measured(i + di, j + dj) - surface.measured(i, j)).norm()) / surface.spacing_mm - 1;
      count += 1;
    }
  return count > 0 ? 100 * sum / count : std::nan("");
}

/// Share of the page's measured nodes on which something lies, in percent.
double covered_percent(const PageSurface& surface) {
  double covered = 0, paper = 0;
  for (const PixelStatus status : surface.status.pixels()) {
    covered += status == PixelStatus::covered;
    paper += status == PixelStatus::ok;
  }
  return covered + paper > 0 ? 100 * covered / (covered + paper) : 0;
}

double unseen_share(const ScanMap& map) {
  double unseen = 0;
  for (const float u : map.u.pixels()) unseen += std::isnan(u);
  return map.u.size() > 0 ? 100 * unseen / static_cast<double>(map.u.size()) : 0;
}

void add_geometry(const Page& page, const PageSurface& surface, const Image<float>& light, Figures& figures) {
  const char* unmeasured = "nothing of the page was measured";
  figures.add("scale_error_across", "the measured surface longer than the flat page, along the lines",
              scale_error(surface, true), "%", unmeasured);
  figures.add("scale_error_down", "the same across the lines", scale_error(surface, false), "%", unmeasured);
  const LineStraightness lines = measure_lines(light, page.picture.pixels_per_mm);
  const char* no_lines = "no text lines of 60 mm and more were found";
  const auto known = [&](double value) { return lines.lines > 0 ? value : std::nan(""); };
  figures.add("lines", "text lines that were long enough to judge", lines.lines, "");
  figures.add("line_straightness", "baselines from straight lines, rms", known(lines.rms_mm), "mm", no_lines);
  figures.add("line_straightness_100", "baselines within 100 mm, largest but 5 %", known(lines.largest_in_100_mm), "mm",
              no_lines);
  figures.add("skew", "of the text lines, clockwise", known(lines.skew_rad * 180 / M_PI), "degrees", no_lines);
  figures.add("measured", "share of the page that rests on measured points", 100 * page.measured_share, "%");
  figures.add("covered", "share on which something lies", covered_percent(surface), "%");
  figures.add("unseen", "share that the scan does not show", unseen_share(page.scan_map), "%");
}

void add_resolution(const PageQuality& quality, Figures& figures) {
  const ResolutionMap& map = quality.resolution;
  const char* unseen = "the scan shows nothing of the page";
  figures.add("page_resolution", "of the page's file", map.page_dpi, "dpi");
  figures.add("resolution_across", "scan pixels an inch of paper along the lines, on all but 5 % of the page",
              map.lowest_across_dpi, "dpi", unseen);
  figures.add("resolution_down", "the same across the lines", map.lowest_down_dpi, "dpi", unseen);
}

void add_sharpness(const PageQuality& quality, ResampleKernel kernel, Figures& figures) {
  const double pixels_per_mm = quality.resolution.page_dpi / 25.4;
  const char* no_edges = "too few straight edges of print were found";
  for (std::size_t k = 0; k < 2; ++k) {
    const EdgeSharpness& edges = quality.sharpness[k];
    const std::string side = k == 0 ? "across" : "down", axis = k == 0 ? "along the lines" : "across the lines";
    const bool known = !edges.page.values.empty();
    const auto figure = [&](const std::string& name, const std::string& what, double value, const char* unit) {
      figures.add((name + "_" + side).c_str(), what + ", " + axis, known ? value : std::nan(""), unit, no_edges);
    };
    figures.add(("edges_" + side).c_str(), "edges of print that were used, " + axis, edges.edges, "");
    figure("mtf50", "frequency at which half of the contrast is left", edges.page.frequency_at(0.5) * pixels_per_mm,
           "lines/mm");
    figure("mtf10", "frequency at which a tenth is left", edges.page.frequency_at(0.1) * pixels_per_mm, "lines/mm");
    figure("sampling_efficiency", "that frequency over half the pixels' own",
           100 * std::min(1.0, edges.page.frequency_at(0.1) / nyquist), "%");
    const double scan_px = (k == 0 ? quality.resolution.typical_across_dpi : quality.resolution.typical_down_dpi) /
                           quality.resolution.page_dpi;
    const double width = std::max(1.0, scan_px);
    figures.add(("kernel_mtf_" + side).c_str(), "contrast that the resampling kernel keeps at half the limit, " + axis,
                100 * kernel_mtf(kernel, width, 0.5 * nyquist / scan_px), "%");
    const bool both = known && !edges.scan.values.empty();
    figures.add(("resampling_mtf_" + side).c_str(), "contrast of the page over that of the scan there, " + axis,
                both ? 100 * edges.page.at(0.5 * nyquist) / edges.scan.at(0.5 * nyquist) : std::nan(""), "%", no_edges);
  }
}

void add_look(const PaperLook& look, Figures& figures) {
  const char* no_paper = "too little blank paper";
  figures.add("paper", "light of blank paper, of the range", 100 * look.level, "%", no_paper);
  figures.add("non_uniformity", "blank paper's light, darkest against brightest", 100 * look.non_uniformity, "%",
              no_paper);
  figures.add("noise", "of blank paper, in CIE L*", look.noise_l_star, "L*", no_paper);
  figures.add("clipped_white", "pixels with a sample at the top of the range", 100 * look.clipped_white, "%");
  figures.add("clipped_black", "pixels that are black altogether", 100 * look.clipped_black, "%");
}

/// A rule of the verdict.
struct Rule {
  const char* name;
  double look, bad;
  bool more_is_better;
  const char* reason;
};

void judge(const QualityOptions& o, PageQuality& quality) {
  const Rule rules[] = {
      {"measured", o.look_measured, o.bad_measured, true, "only {:.3g} % of the page rests on measured points"},
      {"unseen", o.look_unseen, o.bad_unseen, false, "the scan does not show {:.3g} % of the page"},
      {"covered", o.look_covered, o.bad_covered, false, "something lies on {:.3g} % of the page"},
      {"sampling_efficiency_across", o.look_efficiency, o.bad_efficiency, true,
       "print is blurred along the lines: sampling efficiency {:.3g} %"},
      {"sampling_efficiency_down", o.look_efficiency, o.bad_efficiency, true,
       "print is blurred across the lines: sampling efficiency {:.3g} %"},
      {"resolution_across", o.look_resolution, o.bad_resolution, true,
       "parts of the page have only {:.3g} dpi along the lines"},
      {"resolution_down", o.look_resolution, o.bad_resolution, true,
       "parts of the page have only {:.3g} dpi across the lines"},
      {"scale_error_across", o.look_scale, o.bad_scale, false, "the scale is off by {:.3g} % along the lines"},
      {"scale_error_down", o.look_scale, o.bad_scale, false, "the scale is off by {:.3g} % across the lines"},
      {"noise", o.look_noise, o.bad_noise, false, "the picture is noisy: {:.3g} L*"},
      {"non_uniformity", o.look_uniformity, o.bad_uniformity, false, "blank paper varies by {:.3g} % over the page"},
      {"clipped_white", o.look_clipped, o.bad_clipped, false, "{:.3g} % of the page are overexposed"},
  };
  for (const PageVerdict level : {PageVerdict::scan_again, PageVerdict::look})
    for (const Rule& rule : rules) {
      const double value = quality.value(rule.name);
      const auto beyond = [&](double limit) { return rule.more_is_better ? value < limit : std::abs(value) > limit; };
      const bool bad = beyond(rule.bad);
      if (level == PageVerdict::scan_again ? !bad : bad || !beyond(rule.look)) continue;
      quality.verdict = std::max(quality.verdict, level);
      quality.reasons.push_back(fmt::format(fmt::runtime(rule.reason), value));
    }
}

}  // namespace

double PageQuality::value(std::string_view name) const {
  const auto at = std::ranges::find_if(figures, [&](const QualityFigure& f) { return f.figure.name == name; });
  return at == figures.end() ? std::nan("") : at->figure.value;
}

PageQuality measure_quality(const Page& page, const PageSurface& surface, const PictureLight& scan,
                            ResampleKernel kernel, const QualityOptions& options) {
  PageQuality quality;
  quality.index = page.index;
  const Image<float> light = light_of_page(page);
  quality.resolution = map_resolution(page);
  quality.paper = look_at_paper(page, light);
  quality.sharpness = measure_sharpness(page, light, scan);
  Figures figures(quality);
  add_geometry(page, surface, light, figures);
  add_resolution(quality, figures);
  add_sharpness(quality, kernel, figures);
  add_look(quality.paper, figures);
  judge(options, quality);
  return quality;
}

std::vector<PageQuality> measure_quality(std::span<const Page> pages, std::span<const PageSurface> surfaces,
                                         const Picture& scan, ResampleKernel kernel, const QualityOptions& options) {
  const PictureLight scan_light(scan);
  std::vector<PageQuality> qualities;  // one after the other: the light of two pages at once would be 70 MB more
  for (std::size_t k = 0; k < pages.size(); ++k)
    qualities.push_back(measure_quality(pages[k], surfaces[k], scan_light, kernel, options));
  return qualities;
}

}  // namespace pagesweep
