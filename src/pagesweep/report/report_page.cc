// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "pagesweep/report/html.h"

namespace pagesweep {
namespace {

constexpr int page_px = 1100;    // longest side of an embedded page
constexpr int spread_px = 1400;  // of the scan of two of them
constexpr int relief_px = 1000;  // of the plan of the surface
constexpr int map_px = 520;      // of a camera's map

/// What a reason means, for somebody who has not read the code.
std::string_view words_of(PixelStatus status) {
  switch (status) {
    case PixelStatus::ok:
      return "measured";
    case PixelStatus::not_computed:
      return "not looked at";
    case PixelStatus::too_dark:
      return "too dark: the stripe hardly shows (black print, shadow, outside the table)";
    case PixelStatus::truncated:
      return "lit before the first or after the last frame";
    case PixelStatus::saturated:
      return "overexposed: too few samples below saturation";
    case PixelStatus::bad_fit:
      return "light that is not the stripe's alone: gloss, interreflection, movement";
    case PixelStatus::outside_view:
      return "outside the other camera's picture";
    case PixelStatus::no_match:
      return "nothing agrees in the other camera: usually hidden from it";
    case PixelStatus::ambiguous:
      return "more than one place agrees in the other camera";
    case PixelStatus::inconsistent:
      return "matching back ends elsewhere";
    case PixelStatus::outside_depth:
      return "outside the depth range";
    case PixelStatus::rays_miss:
      return "the two viewing rays do not meet";
    case PixelStatus::off_surface:
      return "an outlier to the surface around it";
    case PixelStatus::hidden:
      return "not seen";
    case PixelStatus::covered:
      return "covered by what is not the paper: a finger, a clip, a slip";
  }
  return "unknown";
}

// The verdict ---------------------------------------------------------------------------------------------------------

std::string format_verdict(const Verdict& verdict, std::span<const std::string> warnings) {
  std::string remarks;
  for (const std::string& remark : verdict.remarks) remarks += "<li>" + escape_html(remark) + "</li>";
  for (const std::string& warning : warnings) remarks += "<li>" + escape_html(warning) + "</li>";
  if (!remarks.empty()) remarks = "<ul>" + remarks + "</ul>";
  return fmt::format("<div class=\"verdict {}\"><p class=\"headline\">{}.</p><p class=\"advice\">{}</p>{}</div>\n",
                     name_of(verdict.level), escape_html(verdict.headline), escape_html(verdict.advice), remarks);
}

std::string format_tiles(const ReportInputs& inputs) {
  std::string tiles;
  double points = 0;
  int frames = 0, dropped = 0;
  for (const CameraReport& camera : inputs.cameras) {
    if (camera.points)
      points += static_cast<double>(count_status(camera.points->status)[static_cast<std::size_t>(PixelStatus::ok)]);
    frames = std::max(frames, camera.frames);
    dropped += camera.dropped;
  }
  for (const Page& page : inputs.pages)
    if (const double scale = page.picture.pixels_per_mm; scale > 0)
      tiles += format_tile(fmt::format("{:.1f} × {:.1f}", page.picture.width() / scale, page.picture.height() / scale),
                           "mm", fmt::format("page {} at {:.0f} dpi", page.index, 25.4 * scale));
  tiles += format_tile(format_number(points), "", "points");
  tiles += format_tile(format_number(typical_sigma(inputs.cameras)), "mm", "typical depth error, claimed");
  if (frames > 0)
    tiles += format_tile(
        fmt::format("{}", frames), "",
        dropped == 0 ? "frames a camera, none dropped" : fmt::format("frames a camera, {} dropped", dropped));
  double seconds = 0;
  for (const StationTime& time : inputs.times) seconds += time.seconds;
  if (seconds > 0) tiles += format_tile(format_number(seconds), "s", "to measure and flatten");
  return "<div class=\"tiles\">" + tiles + "</div>\n";
}

// Pages and surface ---------------------------------------------------------------------------------------------------

std::string format_pages(const ReportInputs& inputs, const PictureEncoder& encoder) {
  std::string before, after;
  if (const Picture scan = inputs.scan ? crop_to_pages(*inputs.scan, inputs.pages) : Picture{}; scan.width() > 0) {
    PictureFigure figure = photo_figure(scan, inputs.pages.size() > 1 ? spread_px : page_px, encoder);
    figure.title = "As scanned.";
    figure.caption =
        "The scanner sees the curved paper from above: print is squeezed where the paper falls off towards the gutter.";
    before = format_figure(figure);
  }
  for (const Page& page : inputs.pages) {
    if (page.picture.width() == 0) continue;
    PictureFigure figure = photo_figure(page.picture, page_px, encoder);
    figure.title = fmt::format("Page {}, flat.", page.index);
    figure.caption =
        fmt::format("True to scale; turned by {}° to stand upright. {:.1f} % of it rest on measured points.",
                    format_number(page.deskew_rad * 180 / M_PI), 100 * page.measured_share);
    after += format_figure(figure);
  }
  // A spread on one row and its pages on the next are to the same scale; a single page stands beside its scan.
  return inputs.pages.size() > 1 ? format_row("one", before) + format_row("two", after)
                                 : format_row("two", before + after);
}

std::string format_strain(const PageSurface& surface, const PictureEncoder& encoder) {
  if (surface.strain.size() == 0) return "";
  Image<float> strain = surface.strain;
  for (float& value : strain.pixels()) value *= 1000;
  const StrainSummary summary = summarise_strain(surface);
  PictureFigure figure = map_figure(strain, Ramp::diverging, symmetric_range_of(strain, 0.03), "per mille", encoder);
  figure.title = fmt::format("Page {}: strain.", surface.index);
  figure.caption = fmt::format(
      "Where the measured sheet is longer (red) or shorter (blue) than laid flat. Paper does not stretch: {:.2g} % of "
      "it seems to, by more than the measurement explains.",
      100 * summary.unexplained_share);
  return format_figure(figure);
}

std::string format_relief(const ReportInputs& inputs, const PictureEncoder& encoder) {
  std::vector<const PointMap*> maps;
  for (const CameraReport& camera : inputs.cameras)
    if (camera.points) maps.push_back(camera.points);
  const HeightField field = make_height_field(maps, relief_px);
  if (field.height.empty()) return "";
  const Range range = range_of(field.height, 0.005);
  PictureFigure relief = photo_figure(draw_relief(field, range), relief_px, encoder);
  relief.title = "The measured surface from above.";
  relief.caption =
      "Shaded as if it were plaster lit from the upper left, slopes doubled. Colour is height; gray is where nothing "
      "was "
      "measured.";
  relief.has_bar = true;
  relief.range = range;
  relief.unit = "mm";
  std::string differences;
  for (const PageSurface& surface : inputs.surfaces) {
    const Image<float> difference = difference_of(surface);
    PictureFigure figure = map_figure(difference, Ramp::diverging, symmetric_range_of(difference, 0.03), "mm", encoder);
    figure.title = fmt::format("Page {}: what the {} model misses.", surface.index, surface.model_name);
    figure.caption =
        "Measured surface above (red) or below (blue) the model. The difference vector carries it into the page.";
    differences += format_figure(figure) + format_strain(surface, encoder);
  }
  if (differences.empty()) return format_figure(relief);
  return format_row("surface", format_figure(relief) + differences);
}

// Cameras -------------------------------------------------------------------------------------------------------------

std::string format_times(const CameraReport& camera, const PictureEncoder& encoder) {
  if (!camera.times) return "";
  const Image<float> amplitude = shrink(camera.times->amplitude, map_px);
  PictureFigure light = map_figure(amplitude, Ramp::gray, {0, 1.1 * range_of(amplitude).high}, "gray values", encoder);
  light.title = camera.name + ": light.";
  light.caption = "How far the stripe rises above the background at each pixel. Dark print gives less certain times.";

  const Image<float> time = shrink(camera.times->time, map_px);
  const Range range = range_of(time, 0.002);
  const double step = round_step(range, 16);
  PictureFigure when = photo_figure(draw_contours(time, Ramp::sequential, range, step), map_px, encoder);
  when.title = camera.name + ": time.";
  when.caption =
      fmt::format("When the stripe's middle passed. A line every {} frames; where the lines bend, the surface does.",
                  format_number(step));
  when.has_bar = true;
  when.range = range;
  when.unit = "frames";
  return format_figure(light) + format_figure(when);
}

std::string format_points(const CameraReport& camera, const PictureEncoder& encoder) {
  if (!camera.points) return "";
  const Image<float> sigma = shrink(camera.points->sigma, map_px);
  // The table beside the page may be ten times as uncertain: it must not take all the colours.
  const double highest = std::min(range_of(sigma, 0.02).high, 4 * range_of(sigma, 0.5).high);
  PictureFigure certainty = map_figure(sigma, Ramp::sequential, {0, highest}, "mm", encoder);
  certainty.title = camera.name + ": depth error.";
  certainty.caption =
      "One standard deviation along the viewing ray, as the two time values predict it. Print is darker, "
      "hence less certain.";

  const Image<PixelStatus> status = shrink(camera.points->status, map_px);
  PictureFigure why;
  why.url = encoder.drawing(draw_status(status));
  why.width = status.width();
  why.height = status.height();
  why.title = camera.name + ": status.";
  why.caption = "Where there is no point, and why. The colours are explained below.";
  return format_figure(certainty) + format_figure(why);
}

std::string format_status_table(const ReportInputs& inputs) {
  std::vector<StatusCounts> counts;
  std::string head;
  for (const CameraReport& camera : inputs.cameras) {
    if (!camera.points) continue;
    counts.push_back(count_status(camera.points->status));
    head += fmt::format("<th class=\"n\">{}</th><th class=\"n\"></th>", escape_html(camera.name));
  }
  std::string rows;
  for (std::size_t s = 0; s < names_of(PixelStatus{}).size(); ++s) {
    const auto status = static_cast<PixelStatus>(s);
    if (std::all_of(counts.begin(), counts.end(), [&](const StatusCounts& c) { return c[s] == 0; })) continue;
    rows += fmt::format("<tr><td><span class=\"swatch\" style=\"background:{}\"></span>{}</td>",
                        css_colour(colour_of(status)), escape_html(words_of(status)));
    for (const StatusCounts& of_camera : counts) {
      double all = 0;
      for (const std::size_t count : of_camera) all += static_cast<double>(count);
      rows +=
          fmt::format("<td class=\"n\">{}</td><td class=\"n\">{:.1f} %</td>",
                      format_number(static_cast<double>(of_camera[s])), 100 * static_cast<double>(of_camera[s]) / all);
    }
    rows += "</tr>\n";
  }
  if (rows.empty()) return "";
  return fmt::format("<table><tr><th>status of a pixel</th>{}</tr>\n{}</table>\n", head, rows);
}

std::string format_cameras(const ReportInputs& inputs, const PictureEncoder& encoder) {
  std::string html;
  for (const CameraReport& camera : inputs.cameras) {
    const std::string times = format_times(camera, encoder), points = format_points(camera, encoder);
    html += format_row(times.empty() || points.empty() ? "two" : "four", times + points);
  }
  const std::string table = format_status_table(inputs);
  std::string profile = format_profile(inputs.profile);
  if (!profile.empty())
    profile = "<figure>" + profile +
              "<figcaption><b>The stripe as a pixel sees it.</b> Light over time in frames, learned from this capture; "
              "every time value is the place of this shape in a pixel's gray values.</figcaption></figure>\n";
  if (table.empty() || profile.empty()) return html + table + profile;
  return html + format_row("wide", "<div>" + table + "</div>" + profile);
}

// Quality -------------------------------------------------------------------------------------------------------------

std::string format_quality_table(const PageQuality& quality) {
  std::string rows;
  for (const QualityFigure& entry : quality.figures) {
    const Figure& figure = entry.figure;
    const std::string value =
        std::isnan(figure.value)
            ? "<span class=\"u\">" + escape_html(figure.reason) + "</span>"
            : fmt::format("{} <span class=\"u\">{}</span>", format_number(figure.value), escape_html(figure.unit));
    rows += fmt::format("<tr><td>{}</td><td class=\"n\">{}</td><td>{}</td><td>{}</td></tr>\n", escape_html(figure.what),
                        value, escape_html(entry.fadgi), escape_html(entry.iso));
  }
  return "<table><tr><th></th><th class=\"n\"></th><th>FADGI</th><th>ISO 19264-1</th></tr>\n" + rows + "</table>\n";
}

std::string format_quality_maps(const PageQuality& quality, const PictureEncoder& encoder) {
  const auto figure = [&](const Image<float>& values, Range range, const char* unit, const char* title,
                          const char* caption) {
    if (values.empty()) return std::string();
    PictureFigure picture = map_figure(values, Ramp::sequential, range, unit, encoder);
    picture.title = fmt::format("Page {}: {}", quality.index, title);
    picture.caption = caption;
    return format_figure(picture);
  };
  const ResolutionMap& map = quality.resolution;
  const Range across = range_of(map.across_dpi), down = range_of(map.down_dpi);
  const Range both{std::min(across.low, down.low), std::max(across.high, down.high)};
  return format_row(
      "four", figure(map.across_dpi, both, "dpi", "resolution along the lines.",
                     "Pixels of the scan an inch of paper. Less than the page's own: the paper was seen at a slant.") +
                  figure(map.down_dpi, both, "dpi", "resolution across the lines.", "The same from line to line.") +
                  figure(quality.paper.levels, range_of(quality.paper.levels), "", "blank paper.",
                         "Light of the paper between the letters: how evenly the page is lit."));
}

std::string format_quality(const ReportInputs& inputs, const PictureEncoder& encoder) {
  std::string html;
  for (const PageQuality& quality : inputs.quality) {
    html += fmt::format("<h3>Page {}: {}</h3>\n", quality.index,
                        quality.verdict == PageVerdict::good   ? "good"
                        : quality.verdict == PageVerdict::look ? "deserves a look"
                                                               : "scan it again");
    for (const std::string& reason : quality.reasons) html += "<p>" + escape_html(reason) + ".</p>\n";
    html += format_quality_maps(quality, encoder) + format_quality_table(quality);
  }
  return html;
}

// Tables --------------------------------------------------------------------------------------------------------------

std::string format_value(const OptionValue& option) {
  return std::visit(
      [](const auto& value) -> std::string {
        using Value = std::decay_t<decltype(value)>;
        if constexpr (std::is_same_v<Value, bool>) return value ? "on" : "off";
        if constexpr (std::is_same_v<Value, std::string>) return escape_html(value);
        if constexpr (std::is_arithmetic_v<Value>) return fmt::format("{}", value);
      },
      option.value);
}

std::string format_exposure(const ReportInputs& inputs) {
  std::string lines;
  for (const CameraReport& camera : inputs.cameras)
    if (!camera.exposure.empty())
      lines += fmt::format("<li>{}: {}.</li>\n", escape_html(camera.name), escape_html(camera.exposure));
  return lines.empty() ? "" : "<h3>Exposure</h3>\n<ul>" + lines + "</ul>\n";
}

std::string format_details(const ReportInputs& inputs) {
  std::vector<Figure> figures = inputs.figures;
  for (const CameraReport& camera : inputs.cameras)
    figures.insert(figures.end(), camera.figures.begin(), camera.figures.end());
  std::string html = format_exposure(inputs) + format_figures(figures);
  if (!inputs.times.empty()) {
    html += "<h3>Time taken</h3>\n<table>";
    for (const StationTime& time : inputs.times)
      html += fmt::format("<tr><td>{}</td><td class=\"n\">{} <span class=\"u\">s</span></td></tr>\n",
                          escape_html(time.station), format_number(time.seconds));
    html += "</table>\n";
  }
  if (inputs.options.empty()) return html;
  html += "<h3>Options</h3>\n<details><summary>All options of this run</summary><table>";
  for (const OptionValue& option : inputs.options)
    html += fmt::format("<tr><td>{}</td><td>{}</td><td class=\"n\">{} <span class=\"u\">{}</span></td></tr>\n",
                        escape_html(option.station), escape_html(option.name), format_value(option),
                        escape_html(option.unit));
  return html + "</table></details>\n";
}

}  // namespace

std::string format_report(const ReportInputs& inputs, const Verdict& verdict, const PictureEncoder& encoder) {
  std::string html = format_page_head("Scan report", inputs.title);
  html += format_verdict(verdict, inputs.warnings);
  html += format_tiles(inputs);
  html += format_section("Pages", "Each page as the scanner saw it, and laid flat with the measured surface.",
                         format_pages(inputs, encoder));
  html +=
      format_section("Quality",
                     "In the terms of FADGI (2023) and ISO 19264-1, as far as a page tells without a target. What each "
                     "figure means and where the limits come from is in docs/quality.md.",
                     format_quality(inputs, encoder));
  html +=
      format_section("Surface", "Every pixel of both cameras that saw the stripe pass gives one point of the paper.",
                     format_relief(inputs, encoder));
  html += format_section(
      "Measurement",
      "From light to points: how bright the stripe was at each pixel, when it passed, how certain the depth is "
      "that follows, and where there is none.",
      format_cameras(inputs, encoder));
  html += std::string(evaluation_begin) + std::string(evaluation_end) + "\n";
  html += format_section("Details", "", format_details(inputs));
  html += fmt::format("<footer>{}</footer>\n</body></html>\n", escape_html(inputs.program));
  return html;
}

std::string format_evaluation(std::span<const Figure> figures, std::span<const FigureMap> maps,
                              const PictureEncoder& encoder) {
  std::string pictures;
  for (const FigureMap& map : maps) {
    const Image<float> values = shrink(map.values, map_px);
    const Range range = map.is_signed ? symmetric_range_of(values) : Range{0, range_of(values).high};
    PictureFigure figure =
        map_figure(values, map.is_signed ? Ramp::diverging : Ramp::sequential, range, map.unit, encoder);
    figure.title = map.what + ".";
    figure.caption = map.caption;
    pictures += format_figure(figure);
  }
  return format_section(
      "Against the truth",
      "This capture is synthetic, so what should have been measured is known. The figures are defined in "
      "docs/evaluation.md.",
      format_row(maps.size() > 2 ? "four" : "two", pictures) + format_figures(figures));
}

}  // namespace pagesweep
