// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/dewarping/page_outline.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "pagesweep/base/error.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/dewarping/edge_line_internal.h"
#include "pagesweep/dewarping/flat_preview_internal.h"
#include "pagesweep/dewarping/page_pieces_internal.h"
#include "pagesweep/dewarping/text_direction_internal.h"

namespace pagesweep {
namespace {

constexpr double reach_mm = 8;           // beyond the grid, where the paper's edge is still sought
constexpr double max_turn_rad = 0.2;     // 11 degrees: more is not a page laid down straight
constexpr double min_edge_mm = 15;       // of straight edge that must be seen
constexpr double least_contrast = 0.15;  // of the paper's brightness, between paper and table
constexpr std::array all_sides{PageSide::left, PageSide::right, PageSide::top, PageSide::bottom};

/// The preview as seen from one side: lines across that edge run from outside inwards.
struct SideOfPreview {
  PageSide side;
  const FlatPreview& preview;

  bool is_upright() const { return side == PageSide::left || side == PageSide::right; }
  bool is_reversed() const { return side == PageSide::right || side == PageSide::bottom; }
  int lines() const { return is_upright() ? preview.height() : preview.width(); }
  int depth() const { return is_upright() ? preview.width() : preview.height(); }
  template <class T>
  const T& at(const Image<T>& image, int line, int deep) const {
    const int across = is_reversed() ? depth() - 1 - deep : deep;
    return is_upright() ? image(across, line) : image(line, across);
  }
  /// Paper coordinates (s, t) of a place `along_mm` the side, `across_mm` inwards.
  Eigen::Vector2d paper_at(double along_mm, double across_mm) const {
    const double along = along_mm / preview.pitch_mm;
    const double across = is_reversed() ? depth() - 1 - across_mm / preview.pitch_mm : across_mm / preview.pitch_mm;
    return is_upright() ? Eigen::Vector2d(preview.s_of(across), preview.t_of(along))
                        : Eigen::Vector2d(preview.s_of(along), preview.t_of(across));
  }
};

bool is_gutter(const PageSurface& surface, PageSide side) {
  return (side == PageSide::left && surface.gutter_at_left) || (side == PageSide::right && surface.gutter_at_right);
}

/// The value below which that share of them lies.
double quantile(std::vector<float> values, double share) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * double(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// Blank paper: nearly the brightest of what was measured (of all, if nothing was).
double paper_brightness(const FlatPreview& preview, const Image<float>& levels) {
  const auto shown = [&](bool measured) {
    std::vector<float> values;
    for (std::size_t k = 0; k < levels.size(); ++k)
      if (!std::isnan(preview.brightness.data()[k]) && (!measured || preview.measured.data()[k]))
        values.push_back(levels.data()[k]);
    return values;
  };
  std::vector<float> values = shown(true);
  if (values.empty()) values = shown(false);
  if (values.empty())
    throw no_result("the scan shows no part of the page: does the rig's scanner belong to this scan?");
  return quantile(std::move(values), 0.85);
}

/// The table at one side: the typical brightness of the outermost 2 mm that the scan shows, as far as that is darker
/// than paper; nothing if paper, or nothing at all, is seen there.
std::optional<double> table_brightness(const SideOfPreview& side, const Image<float>& levels, double paper) {
  constexpr int rim = 4;  // cells
  std::vector<float> dark;
  std::size_t seen = 0;
  for (int line = 0; line < side.lines(); ++line)
    for (int deep = 0, in_rim = 0; deep < side.depth() && in_rim < rim; ++deep) {
      if (std::isnan(side.at(side.preview.brightness, line, deep))) continue;
      ++in_rim;
      ++seen;
      const float brightness = side.at(levels, line, deep);
      if (brightness < (1 - least_contrast) * paper) dark.push_back(brightness);
    }
  if (dark.size() < 16 || double(dark.size()) < 0.2 * double(seen)) return std::nullopt;
  return quantile(dark, 0.5);
}

/// Cells that belong to the page: brighter than the threshold, and in one piece with much of it or mostly measured. A
/// ruler or colour target beside the page is neither.
Image<char> find_paper(const FlatPreview& preview, const Image<float>& cells, double threshold) {
  Image<char> bright(preview.width(), preview.height());
  for (std::size_t k = 0; k < bright.size(); ++k)
    bright.data()[k] = cells.data()[k] > threshold && !std::isnan(preview.brightness.data()[k]);
  return keep_page_pieces(bright, preview.measured);
}

/// The first paper on every line across a side. Lines on which less than 1.5 mm of table is seen in front of it are
/// left out: there the scan may cut through the print.
std::vector<EdgePoint> first_paper(const SideOfPreview& side, const Image<char>& paper) {
  constexpr int least_table = 3;  // cells
  std::vector<EdgePoint> points;
  for (int line = 0; line < side.lines(); ++line) {
    int deep = 0;
    while (deep < side.depth() && !side.at(paper, line, deep)) ++deep;
    if (deep < least_table || deep == side.depth()) continue;
    if (std::isnan(side.at(side.preview.brightness, line, deep - least_table))) continue;
    points.push_back({line * side.preview.pitch_mm, (deep - 0.5) * side.preview.pitch_mm});
  }
  return points;
}

/// The light behind a brightness, near enough: pictures for people are encoded with a gamma of about 2.2. Half height
/// is the edge's place in light only; in a picture that is linear already this errs by a fifth of a pixel, inwards.
double light_of(double brightness) { return std::pow(brightness, 2.2); }

/// The paper's edge on one line across it: where the profile rises most, at half height between the two sides' own
/// light. Nothing if the rise is less than half of that from table to paper: printing, a photo, a shadow.
std::optional<double> locate_edge(const PaperView& view, const Picture& scan, const SideOfPreview& side,
                                  double along_mm, double across_mm, double contrast) {
  constexpr double step_mm = 0.05;
  constexpr int reach = 30, plateau = 8, gap = 4;  // steps
  std::vector<double> profile;
  for (int k = -reach; k <= reach; ++k) {
    const auto pixel = view.position(side.paper_at(along_mm, across_mm + k * step_mm));
    profile.push_back(pixel ? light_of(brightness_at(scan, *pixel)) : std::nan(""));
  }
  const auto mean = [&](int first) {
    double sum = 0;
    for (int k = 0; k < plateau; ++k) sum += profile[static_cast<std::size_t>(first + k)];
    return sum / plateau;
  };
  int best = -1;
  double rise = 0.5 * contrast;
  for (int k = plateau + gap; k + gap + plateau <= 2 * reach + 1; ++k)
    if (const double here = mean(k + gap) - mean(k - gap - plateau); here > rise) {
      rise = here;
      best = k;
    }
  if (best < 0) return std::nullopt;
  const double half = 0.5 * (mean(best + gap) + mean(best - gap - plateau));
  for (int k = best - gap; k < best + gap; ++k) {
    const double low = profile[static_cast<std::size_t>(k)], high = profile[static_cast<std::size_t>(k + 1)];
    if (low <= half && high > half) return across_mm + (k - reach + (half - low) / (high - low)) * step_mm;
  }
  return std::nullopt;
}

/// The edge to a fraction of a scan pixel, from profiles every millimetre.
EdgeLine locate_line(const PaperView& view, const Picture& scan, const SideOfPreview& side, const EdgeLine& coarse,
                     double contrast) {
  constexpr double pitch_mm = 1;
  const int count = static_cast<int>(side.lines() * side.preview.pitch_mm / pitch_mm);
  std::vector<std::optional<EdgePoint>> found(static_cast<std::size_t>(count));
  parallel_rows(count, [&](int i) {
    const double along = (i + 0.5) * pitch_mm;
    if (const auto across = locate_edge(view, scan, side, along, coarse.across_at(along), contrast))
      found[static_cast<std::size_t>(i)] = EdgePoint{along, *across};
  });
  std::vector<EdgePoint> points;
  for (const auto& point : found)
    if (point) points.push_back(*point);
  const auto fine = refine_edge_line(points, coarse);
  return fine && fine->share * double(points.size()) * pitch_mm >= 0.5 * min_edge_mm ? *fine : coarse;
}

/// The preview without the print on it.
struct Blanked {
  Image<float> levels;  ///< spots of up to 2 mm filled: what is dark in it is not text
  Image<float> cells;   ///< spots of up to 1 mm filled, but not the gap between the page and a ruler
  double paper{};       ///< brightness of blank paper
};

Blanked blank_out(const FlatPreview& preview) {
  Blanked blanked{close_dark_spots(preview.brightness, 2), close_dark_spots(preview.brightness, 1), 0};
  blanked.paper = paper_brightness(preview, blanked.levels);
  return blanked;
}

/// The paper's edge on one side as the scan shows it, or nothing.
std::optional<EdgeLine> see_edge(const PaperView& view, const Picture& scan, const SideOfPreview& side,
                                 const Blanked& blanked) {
  const double paper = blanked.paper;
  const auto table = table_brightness(side, blanked.levels, paper);
  if (!table) return std::nullopt;
  const double pitch = side.preview.pitch_mm;
  const Image<char> mask = find_paper(side.preview, blanked.cells, 0.5 * (paper + *table));
  const auto points = first_paper(side, mask);
  const double length = std::max(min_edge_mm, 0.1 * side.lines() * pitch);
  const auto coarse = find_edge_line(points, pitch, pitch, length, max_turn_rad);
  if (!coarse) return std::nullopt;
  return locate_line(view, scan, side, *coarse, light_of(paper) - light_of(*table));
}

/// The end of the surface's grid: the preview's own at the gutter, reach_mm inside it elsewhere.
EdgeLine surface_end(const SideOfPreview& side, bool gutter = false) {
  return {.across_mm = (gutter ? 0 : reach_mm) - 0.5 * side.preview.pitch_mm};
}

/// Where the measured part of the surface ends, as far as the scan shows it; the grid's end if nothing was measured.
EdgeLine measured_end(const SideOfPreview& side, double spacing_mm) {
  const double pitch = side.preview.pitch_mm;
  std::vector<EdgePoint> points;
  for (int line = 0; line < side.lines(); ++line)
    for (int deep = 0; deep < side.depth(); ++deep)
      if (side.at(side.preview.measured, line, deep)) {
        points.push_back({line * pitch, (deep - 0.5) * pitch});
        break;
      }
  if (points.empty()) return surface_end(side);
  if (const auto line = find_edge_line(points, pitch, spacing_mm, min_edge_mm, max_turn_rad)) return *line;
  const auto outermost = std::min_element(points.begin(), points.end(),
                                          [](const auto& a, const auto& b) { return a.across_mm < b.across_mm; });
  return {.across_mm = outermost->across_mm};
}

struct Sides {
  std::array<EdgeLine, 4> lines;
  std::array<OutlineEvidence, 4> evidence{};
};

/// Angle of the page's rightward direction, from s towards t, as an edge line of one side shows it.
double angle_of(PageSide side, const EdgeLine& line) {
  switch (side) {
    case PageSide::left:
      return -std::atan(line.slope);
    case PageSide::right:
      return std::atan(line.slope);
    case PageSide::top:
      return std::atan(line.slope);
    case PageSide::bottom:
      return -std::atan(line.slope);
  }
  return 0;
}

/// The free edges' common direction; nothing if none is precise to 0.2 degrees.
std::optional<double> direction_of_edges(const Sides& sides) {
  constexpr double cut_rad = 0.0005;  // paper is cut square to 0.1 mm over a page
  constexpr double agreement_rad = 0.01;
  struct Vote {
    double angle, weight;
  };
  std::vector<Vote> votes;
  for (const PageSide side : all_sides) {
    const auto k = static_cast<std::size_t>(side);
    if (sides.evidence[k] != OutlineEvidence::paper_edge) continue;
    const double variance = std::pow(sides.lines[k].slope_sigma, 2) + cut_rad * cut_rad;
    if (variance < 0.0035 * 0.0035) votes.push_back({angle_of(side, sides.lines[k]), 1 / variance});
  }
  if (votes.empty()) return std::nullopt;
  // The edge with which most of the others, weighted by precision, agree says who takes part.
  double best = -1, sum = 0, weight = 0;
  for (const Vote& middle : votes) {
    double agreeing = 0, agreeing_sum = 0;
    for (const Vote& vote : votes)
      if (std::abs(vote.angle - middle.angle) < agreement_rad) {
        agreeing += vote.weight;
        agreeing_sum += vote.weight * vote.angle;
      }
    if (agreeing > best) {
      best = weight = agreeing;
      sum = agreeing_sum;
    }
  }
  return sum / weight;
}

/// The rectangle of that direction whose sides pass through the middles of the edge lines.
PageFrame make_frame(const FlatPreview& preview, const Sides& sides, double angle_rad) {
  PageFrame frame{.angle_rad = angle_rad};
  Eigen::Vector2d middle(preview.s_of(0.5 * (preview.width() - 1)), preview.t_of(0.5 * (preview.height() - 1)));
  std::array<double, 4> ends{};
  for (int round = 0; round < 3; ++round) {
    for (const PageSide side : all_sides) {
      const SideOfPreview seen{side, preview};
      const auto k = static_cast<std::size_t>(side);
      const double along = seen.is_upright() ? middle.y() - preview.t0_mm : middle.x() - preview.s0_mm;
      const Eigen::Vector2d paper = seen.paper_at(along, sides.lines[k].across_at(along));
      ends[k] = paper.dot(seen.is_upright() ? frame.right() : frame.down());
    }
    middle = 0.5 * (ends[0] + ends[1]) * frame.right() + 0.5 * (ends[2] + ends[3]) * frame.down();
  }
  frame.corner_mm = ends[0] * frame.right() + ends[2] * frame.down();
  frame.width_mm = ends[1] - ends[0];
  frame.height_mm = ends[3] - ends[2];
  return frame;
}

void add_margin(PageOutline& outline, double margin_mm) {
  const auto margin = [&](PageSide side) {
    return outline.sides[static_cast<std::size_t>(side)] == OutlineEvidence::gutter ? 0 : margin_mm;
  };
  PageFrame& frame = outline.frame;
  frame.corner_mm -= margin(PageSide::left) * frame.right() + margin(PageSide::top) * frame.down();
  frame.width_mm += margin(PageSide::left) + margin(PageSide::right);
  frame.height_mm += margin(PageSide::top) + margin(PageSide::bottom);
}

Sides find_sides(const PaperView& view, const Picture& scan, const FlatPreview& preview) {
  const Blanked blanked = blank_out(preview);
  Sides sides;
  for (const PageSide side : all_sides) {
    const auto k = static_cast<std::size_t>(side);
    const SideOfPreview seen{side, preview};
    if (is_gutter(view.surface(), side)) {
      sides.lines[k] = surface_end(seen, true);
      sides.evidence[k] = OutlineEvidence::gutter;
    } else if (const auto edge = see_edge(view, scan, seen, blanked)) {
      sides.lines[k] = *edge;
      sides.evidence[k] = OutlineEvidence::paper_edge;
    } else {
      sides.lines[k] = measured_end(seen, view.surface().spacing_mm);
      sides.evidence[k] = OutlineEvidence::measured_extent;
    }
  }
  return sides;
}

/// The sides of a page that is not to be cropped.
Sides whole_surface(const PaperView& view, const FlatPreview& preview) {
  Sides sides;
  for (const PageSide side : all_sides) {
    const auto k = static_cast<std::size_t>(side);
    const bool gutter = is_gutter(view.surface(), side);
    sides.lines[k] = surface_end({side, preview}, gutter);
    sides.evidence[k] = gutter ? OutlineEvidence::gutter : OutlineEvidence::surface_end;
  }
  return sides;
}

}  // namespace

PageOutline find_page_outline(const PaperView& view, const Picture& scan, const OutlineOptions& options) {
  const FlatPreview preview = make_flat_preview(view, scan, reach_mm);
  Sides sides = find_sides(view, scan, preview);
  PageOutline outline;
  double angle = 0;
  if (const auto by_edges = options.deskew ? direction_of_edges(sides) : std::nullopt) {
    angle = *by_edges;
    outline.deskew = DeskewEvidence::paper_edges;
  } else if (const auto by_text =
                 options.deskew ? find_text_direction(preview.brightness, max_turn_rad) : std::nullopt) {
    angle = *by_text;
    outline.deskew = DeskewEvidence::text_lines;
  }
  if (!options.crop) sides = whole_surface(view, preview);
  outline.sides = sides.evidence;
  outline.frame = make_frame(preview, sides, angle);
  add_margin(outline, options.margin_mm);
  if (!(outline.frame.width_mm > 1 && outline.frame.height_mm > 1))
    throw no_result("the scan shows no page on the measured surface");
  return outline;
}

}  // namespace pagesweep
