// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/surfacing/fit_surface.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>

#include "pagesweep/base/error.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/surfacing/find_gutter.h"
#include "pagesweep/surfacing/find_items.h"
#include "pagesweep/surfacing/find_paper.h"
#include "pagesweep/surfacing/lay_flat.h"

namespace pagesweep {
namespace {

constexpr double smallest_kink = 0.15;  // change of slope below which two pages do not fix the line where they meet
constexpr double largest_correction_mm = 4;
constexpr double many_outliers = 0.25;
constexpr int draft_rows = 80;
constexpr double nearest_to_gutter_mm = 0.2;
constexpr double mixed_cells = 1;             // beside the gutter: as far as the spot of a pixel reaches
constexpr double least_lift_mm = 0.01;        // of points there, by which they are known to lie between the pages
constexpr double strain_that_matters = 5e-4;  // over 100 mm of paper 0.05 mm
constexpr double share_that_matters = 0.05;

void check(std::span<const PointMap> cameras, const SurfaceOptions& options) {
  if (cameras.empty()) throw std::invalid_argument("fit_surface: at least one camera's points are needed");
  if (!(options.smoothing > 0) || !(options.neighbourhood_mm > 0))
    throw std::invalid_argument("fit_surface: smoothing and neighbourhood must be greater than 0");
  if (!std::isfinite(options.reading_direction_rad))
    throw std::invalid_argument("fit_surface: the reading direction is not a number");
}

RulingFrame frame_of(const Gutter& gutter) { return {{gutter.p_mm, gutter.q_mm}, -std::atan(gutter.slope), 0}; }

/// The field's cells that show paper.
Image<CellMean> cells_of(const HeightField& field, const Image<std::uint8_t>& paper) {
  Image<CellMean> cells(field.columns(), field.rows());
  for (std::size_t k = 0; k < paper.size(); ++k)
    if (paper.data()[k]) cells.data()[k] = field.cells.data()[k];
  return cells;
}

/// The paper on one side of the gutter. A cell on the gutter sees both pages: it gives its points from this side, as
/// far as they are farther than `gap_mm` away.
Image<CellMean> side_of(const HeightField& field, const Image<std::uint8_t>& paper, const RulingFrame& gutter,
                        GutterSide side, double gap_mm) {
  Image<CellMean> page = cells_of(field, paper);
  const Eigen::Vector2d outwards = side == GutterSide::left ? gutter.across() : Eigen::Vector2d(-gutter.across());
  std::vector<PlanPoint> kept;
  for (int j = 0; j < field.rows(); ++j)
    for (int i = 0; i < field.columns(); ++i) {
      const double distance = outwards.dot(Eigen::Vector2d(field.p_of(i), field.q_of(j)) - gutter.origin);
      if (!(page(i, j).weight > 0) || distance > gap_mm + field.cell_mm) continue;
      kept.clear();
      for (const PlanPoint& point : field.surface_points(i, j))
        if (outwards.dot(Eigen::Vector2d(point.p, point.q) - gutter.origin) > gap_mm) kept.push_back(point);
      page(i, j) = mean_of(kept, field.p_of(i), field.q_of(j));
    }
  return page;
}

/// One page of the book: its cells and its model.
struct FittedPage {
  GutterSide gutter = GutterSide::none;
  Image<CellMean> cells;
  std::vector<Support> places;
  RuledSurface model;
};

FittedPage fit_page(const HeightField& field, Image<CellMean> cells, GutterSide side,
                    const std::optional<RulingFrame>& gutter, bool search, const SurfaceOptions& options) {
  FittedPage page;
  page.gutter = side;
  page.cells = std::move(cells);
  page.places = places_of(field, page.cells);
  page.model = fit_ruled_surface(page.places, {gutter, search, options.smoothing});
  return page;
}

/// The line in which both page models meet, near the present gutter.
RulingFrame meeting_line(const RuledSurface& left, const RuledSurface& right, const RulingFrame& gutter) {
  constexpr int places = 15;
  const double from = std::max(left.b_low, right.b_low), to = std::min(left.b_high, right.b_high);
  double n = 0, b1 = 0, b2 = 0, a1 = 0, ab = 0;
  for (int k = 0; k < places; ++k) {
    const double b = from + (to - from) * (k + 0.5) / places;
    const auto gap = [&](double a) {
      const Eigen::Vector2d plan = gutter.plan_from_ruling(a, b);
      return left.height(plan) - right.height(plan);
    };
    double a = 0, slope = 0;
    for (int step = 0; step < 4; ++step) {
      slope = (gap(a + 0.05) - gap(a - 0.05)) / 0.1;
      if (!(slope < -smallest_kink)) break;
      a = std::clamp(a - gap(a) / slope, -largest_correction_mm, largest_correction_mm);
    }
    if (!(slope < -smallest_kink)) continue;
    n += 1;
    b1 += b;
    b2 += b * b;
    a1 += a;
    ab += a * b;
  }
  const double spread = n * b2 - b1 * b1;
  if (2 * n < places || !(spread > 0)) return gutter;
  const double turn = (n * ab - a1 * b1) / spread;
  const double shift = (a1 - turn * b1) / n;
  return {gutter.plan_from_ruling(shift, 0), gutter.angle_rad() - std::atan(turn), 0};
}

/// How far the points beside the gutter, up to `gap_mm` from it, lie above the pages that were fitted without them
/// [mm]. Where a pixel's spot sees both pages, its point lies between them, above the crease.
double lift_at_gutter(const HeightField& field, const Image<std::uint8_t>& paper, const std::vector<FittedPage>& pages,
                      const RulingFrame& gutter, double gap_mm) {
  std::vector<double> lifts;
  for (const FittedPage& page : pages) {
    const Eigen::Vector2d outwards =
        page.gutter == GutterSide::left ? gutter.across() : Eigen::Vector2d(-gutter.across());
    for (int j = 0; j < field.rows(); ++j)
      for (int i = 0; i < field.columns(); ++i) {
        if (!paper(i, j)) continue;
        for (const PlanPoint& point : field.surface_points(i, j)) {
          const double distance = outwards.dot(Eigen::Vector2d(point.p, point.q) - gutter.origin);
          if (distance > nearest_to_gutter_mm && distance < gap_mm)
            lifts.push_back(point.z - page.model.height({point.p, point.q}));
        }
      }
  }
  if (lifts.empty()) return 0;
  const auto middle = lifts.begin() + static_cast<std::ptrdiff_t>(lifts.size() / 2);
  std::nth_element(lifts.begin(), middle, lifts.end());
  return *middle;
}

/// A few rows of a mask: rulings run across them, so that they tell a page's shape as well, with a little more noise.
Image<std::uint8_t> few_rows_of(const Image<std::uint8_t>& mask) {
  const int step = std::max(1, mask.height() / draft_rows);
  Image<std::uint8_t> few(mask.width(), mask.height(), 0);
  for (int j = 0; j < mask.height(); j += step) std::ranges::copy(mask.row(j), few.row(j).begin());
  return few;
}

/// The gutter is where the pages meet, and the pages are what ends at the gutter: from coarse to fine. Until it is
/// known, parallel rulings and drafts from a few rows will do.
std::vector<FittedPage> fit_both_pages(const HeightField& field, const Image<std::uint8_t>& paper, RulingFrame gutter,
                                       const SurfaceOptions& options) {
  const auto fit = [&](const Image<std::uint8_t>& cells, double gap_mm, bool search) {
    std::vector<FittedPage> pages(2);
    parallel_rows(2, [&](int k) {
      const GutterSide side = k == 0 ? GutterSide::right : GutterSide::left;  // of the left page, of the right page
      pages[static_cast<std::size_t>(k)] =
          fit_page(field, side_of(field, cells, gutter, side, gap_mm), side, gutter, search, options);
    });
    return pages;
  };
  const Image<std::uint8_t> few_rows = few_rows_of(paper);
  for (const double gap_mm : {2.0, 0.5}) {
    const auto drafts = fit(few_rows, gap_mm, false);
    gutter = meeting_line(drafts[0].model, drafts[1].model, gutter);
  }
  // What lies between the pages would round the crease, and cost each of them some of its width.
  const double mixed_mm = mixed_cells * field.cell_mm;
  const double lift = lift_at_gutter(field, paper, fit(few_rows, mixed_mm, false), gutter, mixed_mm);
  return fit(paper, lift > least_lift_mm ? mixed_mm : nearest_to_gutter_mm, true);
}

/// A gutter, if the layout is a spread or turns out to be one.
std::optional<RulingFrame> choose_gutter(const HeightField& field, const Image<std::uint8_t>& paper, Layout layout,
                                         Progress& progress) {
  if (layout == Layout::single || layout == Layout::items) return std::nullopt;
  if (const auto gutter = find_gutter(field, paper, layout == Layout::spread)) return frame_of(*gutter);
  if (layout == Layout::automatic) return std::nullopt;
  progress.warn("no gutter was found: the paper is divided in its middle");
  double n = 0;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (const Support& place : places_of(field, cells_of(field, paper))) {
    sum += place.plan;
    n += 1;
  }
  return RulingFrame{sum / std::max(1.0, n), 0, 0};
}

PageSurface sample(const FlatPage& flat, const HeightField& field, SurfaceModel model) {
  PageSurface page = flat.sample(field.frame);
  page.model_name = name_of(model);
  return page;
}

/// Share of the sheet that is longer or shorter, as measured, than in the flattening.
double strained_share(const FlatPage& flat) { return flat.strain().share_beyond(strain_that_matters); }

PageSurface finish_page(const FittedPage& fitted, const HeightField& field, const SurfaceOptions& options) {
  const Differences differences = measure_differences(field, fitted.cells, fitted.model, options.neighbourhood_mm,
                                                      fitted.gutter != GutterSide::none);
  const FlatPage by_model(fitted.model, differences, fitted.places, fitted.gutter, options.straighten);
  // Dents of the paper and the rims of the measurement strain a good cylinder as well, in a few places.
  const bool may_follow = options.model == SurfaceModel::developable ||
                          (options.model == SurfaceModel::automatic && strained_share(by_model) > share_that_matters);
  if (!may_follow) return sample(by_model, field, SurfaceModel::cylinder);
  const Differences creased = crease_differences(differences, fitted.model, options.neighbourhood_mm);
  FlatPage flat = by_model;
  flat.follow_measurement(creased);
  // Points too coarse for the sheet's folds make it one that no paper could be: the model knows better.
  if (options.model == SurfaceModel::automatic && strained_share(flat) > strained_share(by_model))
    return sample(by_model, field, SurfaceModel::cylinder);
  return sample(flat, field, SurfaceModel::developable);
}

}  // namespace

std::vector<PageSurface> fit_surface(std::span<const PointMap> cameras, const SurfaceOptions& options,
                                     Progress& progress) {
  check(cameras, options);
  progress.begin("surface");
  const HeightField field =
      smooth_points(cameras, {options.neighbourhood_mm, 0, options.reading_direction_rad}, progress);
  if (static_cast<double>(field.outliers) > many_outliers * static_cast<double>(field.points))
    progress.warn(fmt::format("{} of {} points lie off the surface around them", field.outliers, field.points));
  const Image<std::uint8_t> paper = find_paper(field, options.layout == Layout::items);
  const auto gutter = choose_gutter(field, paper, options.layout, progress);
  progress.advance(0.5);

  std::vector<FittedPage> fitted;
  if (options.layout == Layout::items)
    for (const Image<std::uint8_t>& item : find_items(field, paper))
      fitted.push_back(fit_page(field, cells_of(field, item), GutterSide::none, std::nullopt, true, options));
  else if (gutter)
    fitted = fit_both_pages(field, paper, *gutter, options);
  else
    fitted.push_back(fit_page(field, cells_of(field, paper), GutterSide::none, std::nullopt, true, options));
  if (fitted.empty()) throw no_result("no sheet of paper was found among the points");
  progress.advance(0.75);

  std::vector<PageSurface> pages(fitted.size());
  parallel_rows(static_cast<int>(fitted.size()), [&](int k) {
    const auto n = static_cast<std::size_t>(k);
    pages[n] = finish_page(fitted[n], field, options);
    pages[n].index = k + 1;
  });
  progress.advance(1);
  return pages;
}

}  // namespace pagesweep
