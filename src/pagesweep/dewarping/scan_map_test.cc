// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/dewarping/scan_map.h"

#include <gtest/gtest.h>

#include <cmath>

#include "pagesweep/base/error.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/dewarping/printed_page_testing.h"

namespace pagesweep {
namespace {

constexpr double scan_scale = 8;  // [px/mm]

std::vector<std::pair<std::string, Scanner>> scanners() { return make_small_scanners(scan_scale, 900, 700); }

/// Largest distance [scan px] from the map to G of the closed form over the page; all pixels must be seen.
double largest_error(const ScanMap& map, const PageFrame& frame, double scale, const Sheet& sheet,
                     const Scanner& scanner) {
  double largest = 0;
  for (int y = 0; y < map.height(); ++y)
    for (int x = 0; x < map.width(); ++x) {
      const Eigen::Vector2d paper = frame.paper_at_pixel(x, y, scale);
      const Eigen::Vector2d error =
          Eigen::Vector2d(map.u(x, y), map.v(x, y)) - *scanner.project(sheet(paper.x(), paper.y()));
      if (!error.allFinite()) return INFINITY;
      largest = std::max(largest, error.norm());
    }
  return largest;
}

TEST(DifferenceVector, IsTheModelsPictureMinusTheMeasurements) {
  // 700 mm above the point, 35 mm beside the middle: 2 mm of height move the picture by f (35 / 698 - 35 / 700).
  const Pushbroom line{1000, 2000, 7000, 500, 0, Eigen::Vector3d(1, -1, -1).asDiagonal(), {0, 100, 700}, {0, -0.1, 0}};
  const auto delta = difference_vector(Scanner(line), {35, 50, 0}, {35, 50, 2});
  ASSERT_TRUE(delta);
  EXPECT_NEAR(delta->x(), 7000 * (35.0 / 700 - 35.0 / 698), 1e-9);
  EXPECT_NEAR(delta->y(), 0, 1e-9);
  EXPECT_FALSE(difference_vector(Scanner(line), {35, 50, 0}, {35, 50, 800}));
}

TEST(DifferenceVector, LeadsFromTheModelToTheMeasuredSpot) {
  const Sheet model = cylinder(60), measured = dented(model, 3, 8, {5, 3});
  const PageSurface surface = make_surface(model, measured, {-40, -30}, {40, 30});
  for (const auto& [name, scanner] : scanners()) {
    const PaperView with(surface, scanner, PaperShape::measured), without(surface, scanner, PaperShape::model);
    for (double s = -35; s < 35; s += 3.7)
      for (double t = -25; t < 25; t += 3.3) {
        const auto delta = difference_vector(scanner, without.point({s, t}), with.point({s, t}));
        EXPECT_LT((*without.position({s, t}) - *delta - *with.position({s, t})).norm(), 1e-9) << name;
      }
  }
}

TEST(ScanMap, FollowsClosedFormsToATenthOfAPixel) {
  // Grids of 2 mm in float, interpolated by cubics, lose (2 mm)^4 times the fourth derivative: 0.002 mm at a radius of
  // 25 mm, and the lattice at most 0.02 px.
  const Sheet bent = cylinder(25);
  for (const Sheet& sheet : {tilted_plane(0.3), bent, dented(bent, 2, 8, {3, -5})}) {
    const PageSurface surface = make_surface(sheet, sheet, {-30, -30}, {30, 30});
    for (const auto& [name, scanner] : scanners())
      for (const double angle : {0.0, 0.05}) {
        const PageFrame frame{{-20, -22}, angle, 40, 42};
        const PaperView view(surface, scanner, PaperShape::measured);
        const ScanMap map = build_scan_map(view, Occlusion(std::span(&view, 1)), frame, 8);
        EXPECT_LT(largest_error(map, frame, 8, sheet, scanner), 0.04) << name;
      }
  }
}

TEST(ScanMap, WithoutTheDifferenceVectorItShowsTheModel) {
  const Sheet model = tilted_plane(0), measured = dented(model, 4, 8, {10, 0});
  const PageSurface surface = make_surface(model, measured, {-30, -30}, {30, 30});
  const PageFrame frame{{-20, -20}, 0, 40, 40};
  for (const auto& [name, scanner] : scanners()) {
    const PaperView view(surface, scanner, PaperShape::model);
    const ScanMap map = build_scan_map(view, Occlusion(), frame, 8);
    EXPECT_LT(largest_error(map, frame, 8, model, scanner), 0.04) << name;
    EXPECT_GT(largest_error(map, frame, 8, measured, scanner), 0.2) << name;
  }
}

TEST(ScanMap, InterpolationStaysWithinItsToleranceOnCreases) {
  // A letter with a sharp fold: the lattice must not smooth over it.
  const Sheet folded = [](double s, double t) { return Eigen::Vector3d(0.8 * s, -t, 20 - 0.6 * std::abs(s - 0.4)); };
  const PageSurface surface = make_surface(folded, folded, {-30, -30}, {30, 30});
  const PageFrame frame{{-25, -25}, 0.03, 50, 50};
  const Scanner scanner = scanners()[1].second;
  const PaperView view(surface, scanner, PaperShape::measured);
  const ScanMap map = build_scan_map(view, Occlusion(), frame, 12, 0.02);
  double largest = 0;
  for (int y = 0; y < map.height(); ++y)
    for (int x = 0; x < map.width(); ++x)
      largest = std::max(
          largest, (Eigen::Vector2d(map.u(x, y), map.v(x, y)) - *view.position(frame.paper_at_pixel(x, y, 12))).norm());
  EXPECT_LT(largest, 0.04);  // the tolerance is checked in the middle of each cell only
}

TEST(ScanMap, EndsAtTheScansBorderAndAtTheGutter) {
  const Sheet sheet = tilted_plane(0);
  PageSurface surface = make_surface(sheet, sheet, {-80, -30}, {80, 30});
  surface.gutter_at_right = true;
  for (const auto& [name, scanner] : scanners()) {  // which see 112 mm along x
    const PaperView view(surface, scanner, PaperShape::measured);
    const PageFrame frame{{-80, -10}, 0, 170, 20};
    const ScanMap map = build_scan_map(view, Occlusion(), frame, 4);
    for (int y = 0; y < map.height(); ++y)
      for (int x = 0; x < map.width(); ++x) {
        const Eigen::Vector2d paper = frame.paper_at_pixel(x, y, 4);
        const bool seen = scanner.sees(*scanner.project(sheet(paper.x(), paper.y()))) && paper.x() <= 80;
        ASSERT_EQ(!std::isnan(map.u(x, y)), seen) << name << " " << paper.transpose();
      }
  }
  surface = make_surface(sheet, sheet, {-40, -30}, {0, 30});
  surface.gutter_at_right = true;
  const Scanner scanner = scanners()[0].second;
  const PaperView view(surface, scanner, PaperShape::measured);
  const ScanMap map = build_scan_map(view, Occlusion(), {{-10, -10}, 0, 20, 20}, 4);
  EXPECT_FALSE(std::isnan(map.u(39, 5)));
  EXPECT_TRUE(std::isnan(map.u(40, 5)));
}

TEST(ScanMap, PaperBehindAnotherPageIsHidden) {
  // A wall of paper 20 mm high at x = 20 hides from a central view what lies behind it at the table, up to
  // x = 20 * 700 / 680 = 20.588 where the ray over its top comes down.
  const Sheet table = tilted_plane(0, 0);
  const Sheet wall = [](double s, double t) { return Eigen::Vector3d(20 - 1e-4 * s, -t, s); };
  const std::vector<PageSurface> surfaces{make_surface(table, table, {-30, -30}, {30, 30}),
                                          make_surface(wall, wall, {0, -30}, {20, 30})};
  for (const auto& [name, scanner] : make_small_scanners(20, 1600, 1200)) {
    std::vector<PaperView> views;
    for (const PageSurface& surface : surfaces) views.emplace_back(surface, scanner, PaperShape::measured);
    const Occlusion occlusion(views);
    const PageFrame frame{{15, -20}, 0, 10, 40};
    const double scale = 40;
    const ScanMap map = build_scan_map(views[0], occlusion, frame, scale);
    const double blur_mm =
        0.25;  // a cell of the depth buffer, 4 scan pixels of 0.05 mm, counts as seen, and its tolerance
    for (int y = 0; y < map.height(); y += 7)
      for (int x = 0; x < map.width(); ++x) {
        const double s = frame.paper_at_pixel(x, y, scale).x();
        if (s < 20 - blur_mm || s > 20.588 + blur_mm) {
          ASSERT_FALSE(std::isnan(map.u(x, y))) << name << " " << s;
        }
        if (s > 20 + blur_mm && s < 20.588 - blur_mm) {
          ASSERT_TRUE(std::isnan(map.u(x, y))) << name << " " << s;
        }
      }
  }
}

TEST(ScanMap, ASteepSlopeDoesNotHideItself) {
  // 80 degrees, seen from the side that is visible: 5.8 mm of height a millimetre across.
  const Sheet steep = [](double s, double t) { return Eigen::Vector3d(-10 + 0.17 * s, -t, 0.98 * s); };
  const PageSurface surface = make_surface(steep, steep, {0, -20}, {40, 20});
  for (const auto& [name, scanner] : scanners()) {
    const PaperView view(surface, scanner, PaperShape::measured);
    const ScanMap map = build_scan_map(view, Occlusion(std::span(&view, 1)), {{1, -19}, 0, 38, 38}, 4);
    for (const float u : map.u.pixels()) ASSERT_FALSE(std::isnan(u)) << name;
  }
}

TEST(ScanMap, DoesNotDependOnTheNumberOfThreads) {
  const Sheet sheet = cylinder(30);
  const PageSurface surface = make_surface(sheet, sheet, {-30, -30}, {30, 30});
  const Scanner scanner = scanners()[2].second;
  const PaperView view(surface, scanner, PaperShape::measured);
  const PageFrame frame{{-20, -20}, 0.02, 40, 40};
  const ScanMap many = build_scan_map(view, Occlusion(), frame, 7);
  const ThreadLimit limit(1);
  const ScanMap one = build_scan_map(view, Occlusion(), frame, 7);
  EXPECT_TRUE(std::equal(many.u.pixels().begin(), many.u.pixels().end(), one.u.pixels().begin()));
  EXPECT_TRUE(std::equal(many.v.pixels().begin(), many.v.pixels().end(), one.v.pixels().begin()));
}

TEST(ScanMap, RefusesNonsense) {
  const Sheet sheet = tilted_plane(0);
  const PageSurface surface = make_surface(sheet, sheet, {-30, -30}, {30, 30});
  const Scanner scanner = scanners()[0].second;
  const PaperView view(surface, scanner, PaperShape::measured);
  EXPECT_THROW(build_scan_map(view, Occlusion(), {{0, 0}, 0, 10, 10}, 0), std::invalid_argument);
  EXPECT_THROW(build_scan_map(view, Occlusion(), {{0, 0}, 0, 10, 10}, NAN), std::invalid_argument);
}

TEST(ScanPixelsPerMm, IsTheMedianScaleOnThePaper) {
  const Sheet sheet = tilted_plane(0, 40);  // where make_small_scanners' scale is exact, but for the distortion
  const PageSurface surface = make_surface(sheet, sheet, {-30, -30}, {30, 30});
  for (const auto& [name, scanner] : scanners()) {
    const PaperView view(surface, scanner, PaperShape::measured);
    const double scale = scan_pixels_per_mm(view, {{-30, -30}, 0, 60, 60});
    EXPECT_NEAR(scale, scan_scale, 2e-3 * scan_scale) << name;
    EXPECT_THROW(scan_pixels_per_mm(view, {{900, 900}, 0, 60, 60}), Error) << name;
  }
}

}  // namespace
}  // namespace pagesweep
