// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/dewarping/page_outline.h"

#include <gtest/gtest.h>

#include <cmath>

#include "pagesweep/base/error.h"
#include "pagesweep/dewarping/edge_line_internal.h"
#include "pagesweep/dewarping/printed_page_testing.h"
#include "pagesweep/dewarping/text_direction_internal.h"

namespace pagesweep {
namespace {

constexpr double degree = 3.14159265358979 / 180;

/// A sheet of paper on a table, both in the (s, t) of the surface that they lie on; brightness in linear light.
struct Desk {
  PageFrame paper{{-50, -60}, 0, 100, 120};
  double table = 0.12;
  bool text = true;
  std::function<double(double x_mm, double y_mm)> extra{};  ///< in page coordinates; NaN: nothing there

  double operator()(double s, double t) const {
    const Eigen::Vector2d at = paper.page_from_paper({s, t});
    if (extra)
      if (const double brightness = extra(at.x(), at.y()); !std::isnan(brightness)) return brightness;
    if (!paper.contains({s, t})) return table;
    return text && is_ink(at) ? 0.15 : 0.85;
  }
  /// Lines of 5 mm pitch with words and letters, 12 mm from the edges.
  bool is_ink(const Eigen::Vector2d& at) const {
    if (at.x() < 12 || at.y() < 12 || at.x() > paper.width_mm - 12 || at.y() > paper.height_mm - 12) return false;
    const double letter = std::fmod(at.x(), 1.7), word = std::fmod(at.x() + 3.1 * std::floor(at.y() / 5), 11);
    return std::fmod(at.y(), 5) < 2 && letter < 1.1 && word < 9;
  }
};

/// Scan, surface and outline of a desk. The grid reaches 10 mm beyond the paper on all sides and, as status says,
/// is measured on the paper only.
struct Outlined {
  PageSurface surface;
  Picture scan;
  Scanner scanner;

  Outlined(const Desk& desk, const Sheet& sheet, int model = 1, int channels = 1, int bit_depth = 8)
      : scanner(make_small_scanners(3, 420, 480)[static_cast<std::size_t>(model)].second) {
    surface = make_surface(sheet, sheet, {-60, -70}, {60, 70});
    for (int j = 0; j < surface.rows(); ++j)
      for (int i = 0; i < surface.columns(); ++i)
        if (!desk.paper.contains({surface.s_of(i), surface.t_of(j)})) surface.status(i, j) = PixelStatus::off_surface;
    scan = render_scan(sheet, scanner, desk, 2, channels, bit_depth);
    for (int y = 0; y < scan.height(); ++y)  // as for a display
      for (int x = 0; x < scan.width(); ++x) set_pixel(scan, x, y, std::pow(pixel_at(scan, x, y), 1 / 2.2));
  }
  PageOutline find(const OutlineOptions& options = {}) const {
    return find_page_outline(PaperView(surface, scanner, PaperShape::measured), scan, options);
  }
};

/// Largest distance [mm] between corresponding corners.
double corner_error(const PageFrame& a, const PageFrame& b) {
  double largest = 0;
  for (const double x : {0.0, 1.0})
    for (const double y : {0.0, 1.0})
      largest = std::max(largest, (a.paper_from_page({x * a.width_mm, y * a.height_mm}) -
                                   b.paper_from_page({x * b.width_mm, y * b.height_mm}))
                                      .norm());
  return largest;
}

TEST(PageOutline, FindsTheCornersOfAPageUnderAllScanners) {
  // A scan pixel is 0.33 mm here; the edge is found to a fraction of it.
  for (int model = 0; model < 3; ++model) {
    const Desk desk{.paper = {{-47, -61}, 0, 98, 119}};
    const PageOutline outline = Outlined(desk, cylinder(120, 30), model).find();
    EXPECT_LT(corner_error(outline.frame, desk.paper), 0.1);
    for (const OutlineEvidence side : outline.sides) EXPECT_EQ(side, OutlineEvidence::paper_edge);
    EXPECT_EQ(outline.deskew, DeskewEvidence::paper_edges);
  }
}

TEST(PageOutline, MeasuresTheTurnToAFiftiethOfADegree) {
  for (const double angle : {1.7 * degree, -4.2 * degree}) {
    const Desk desk{.paper = {{-47 + 60 * std::sin(angle), -58 - 50 * std::sin(angle)}, angle, 94, 116}};
    const PageOutline outline = Outlined(desk, cylinder(150, 20), 1, 3, 16).find();
    EXPECT_NEAR(outline.frame.angle_rad, angle, 0.02 * degree);
    EXPECT_LT(corner_error(outline.frame, desk.paper), 0.2);
  }
}

TEST(PageOutline, FingersPhotosAndTornCornersDoNotMoveTheEdge) {
  const double angle = 1 * degree;
  Desk desk{.paper = {{-48, -60}, angle, 96, 118}};
  const Outlined clean(desk, tilted_plane(0.1));
  desk.extra = [](double x, double y) {
    if (std::hypot(x, (y - 70) / 0.6) < 15) return 0.5;       // a finger from the left
    if (x > 62 && x < 96 && y > 20 && y < 85) return 0.1;     // a dark photo, 65 mm of the right edge
    if (x > 0 && y > 0 && x + y < 25) return 0.12;            // a torn corner
    if (y > 105 && y < 118 && x > 30 && x < 50) return 0.15;  // print up to the lower edge
    if (y < -2.5 && y > -9 && x > 10 && x < 60) return std::fmod(x, 4) < 1 ? 0.1 : 0.8;  // a ruler above the page
    return std::nan("");
  };
  const Outlined marred(desk, tilted_plane(0.1));
  EXPECT_LT(corner_error(clean.find().frame, desk.paper), 0.1);
  EXPECT_LT(corner_error(marred.find().frame, desk.paper), 0.3);
}

TEST(PageOutline, ADarkBandAcrossThePageDoesNotEndIt) {
  Desk desk{.text = false};
  desk.extra = [](double x, double y) { return x >= 0 && x <= 100 && y > 50 && y < 100 ? 0.1 : std::nan(""); };
  EXPECT_LT(corner_error(Outlined(desk, tilted_plane(0)).find().frame, desk.paper), 0.2);
}

TEST(PageOutline, TakesAGrayTableForATable) {
  EXPECT_LT(corner_error(Outlined({.table = 0.55}, tilted_plane(0)).find().frame, PageFrame{{-50, -60}, 0, 100, 120}),
            0.2);
}

TEST(PageOutline, WithoutContrastTheMeasuredExtentAndTheTextDecide) {
  const double angle = 1.7 * degree;
  const Desk desk{.paper = {{-48, -60}, angle, 96, 118}, .table = 0.85};
  const PageOutline outline = Outlined(desk, tilted_plane(0)).find();
  for (const OutlineEvidence side : outline.sides) EXPECT_EQ(side, OutlineEvidence::measured_extent);
  EXPECT_EQ(outline.deskew, DeskewEvidence::text_lines);
  EXPECT_NEAR(outline.frame.angle_rad, angle, 0.1 * degree);
  EXPECT_LT(corner_error(outline.frame, desk.paper), 2);  // the surface's spacing
}

TEST(PageOutline, BlankPaperOnPaperKeepsTheSurfacesDirection) {
  const Desk desk{.paper = {{-48, -60}, 0.02, 96, 118}, .table = 0.85, .text = false};
  const PageOutline outline = Outlined(desk, tilted_plane(0)).find();
  EXPECT_EQ(outline.deskew, DeskewEvidence::none);
  EXPECT_EQ(outline.frame.angle_rad, 0);
}

TEST(PageOutline, EndsWhereTheScanEndsIfThePaperGoesOn) {
  // The scan shows 140 mm along s at 660 mm distance; paper and measurement reach to s = 100.
  const Desk desk{.paper = {{-50, -60}, 0, 150, 120}};
  const Sheet sheet = tilted_plane(0, 40);
  Outlined page(desk, sheet);
  page.surface = make_surface(sheet, sheet, {-60, -70}, {100, 70});
  const PageOutline outline = page.find();
  EXPECT_EQ(outline.sides[0], OutlineEvidence::paper_edge);
  EXPECT_EQ(outline.sides[1], OutlineEvidence::measured_extent);
  EXPECT_NEAR(outline.frame.corner_mm.x(), -50, 0.1);
  EXPECT_NEAR(outline.frame.corner_mm.x() + outline.frame.width_mm, 70, 0.6);  // a cell of the search
}

TEST(PageOutline, TheGutterIsTheEndOfTheGrid) {
  const Sheet sheet = cylinder(120, 30);
  Outlined page({.paper = {{-50, -60}, 0, 100, 120}}, sheet);
  page.surface = make_surface(sheet, sheet, {-60, -70}, {20, 70});
  page.surface.gutter_at_right = true;
  const PageOutline outline = page.find({.margin_mm = 3});
  EXPECT_EQ(outline.sides[1], OutlineEvidence::gutter);
  EXPECT_LT(corner_error(outline.frame, {{-53, -63}, 0, 73, 126}), 0.1);
}

TEST(PageOutline, UncroppedItIsTheGrid) {
  const double angle = 0.03;
  const Desk desk{.paper = {{-48, -60}, angle, 96, 118}};
  const Outlined page(desk, tilted_plane(0));
  const PageOutline outline = page.find({.crop = false});
  EXPECT_NEAR(outline.frame.angle_rad, angle, 0.02 * degree);
  EXPECT_NEAR(outline.frame.width_mm, 120, 0.2);
  EXPECT_NEAR(outline.frame.height_mm, 140, 0.2);
  EXPECT_EQ(outline.sides[0], OutlineEvidence::surface_end);
  EXPECT_EQ(page.find({.deskew = false}).frame.angle_rad, 0);
}

TEST(PageOutline, SaysSoIfTheScanShowsNoPage) {
  Outlined page({}, tilted_plane(0));
  const Sheet elsewhere = [](double s, double t) { return Eigen::Vector3d(s + 1000, -t, 0); };
  page.surface = make_surface(elsewhere, elsewhere, {-60, -70}, {60, 70});
  EXPECT_THROW(page.find(), Error);
}

TEST(EdgeLine, TheOutermostLineWithAFairShareWins) {
  // A photo's border takes 65 % of the side, the paper's edge the rest; a clamp outside of both 10 %.
  std::vector<EdgePoint> points;
  for (int i = 0; i < 400; ++i) {
    const double along = 0.5 * i, edge = 8 + 0.02 * along;
    points.push_back({along, i < 40 ? edge - 5 : i < 300 ? edge + 12 : edge});
  }
  const auto line = find_edge_line(points, 0.5, 0.5, 15, 0.2);
  ASSERT_TRUE(line);
  EXPECT_NEAR(line->across_at(175), 8 + 0.02 * 175, 0.25);  // half a vote's bin
}

TEST(EdgeLine, NeedsALengthOfPoints) {
  std::vector<EdgePoint> points;
  for (int i = 0; i < 20; ++i) points.push_back({0.5 * i, 3});
  EXPECT_FALSE(find_edge_line(points, 0.5, 0.5, 15, 0.2));
  EXPECT_FALSE(find_edge_line({}, 0.5, 0.5, 15, 0.2));
  EXPECT_FALSE(refine_edge_line({}, {}));
}

TEST(TextDirection, IsNotReadOutOfNoise) {
  Image<float> noise(200, 250);
  std::mt19937 random(5);
  for (float& value : noise.pixels()) value = static_cast<float>(random() % 1000) / 1000;
  EXPECT_FALSE(find_text_direction(noise, 0.2));
  EXPECT_FALSE(find_text_direction(Image<float>(200, 250, 0.8f), 0.2));
  EXPECT_FALSE(find_text_direction(Image<float>(200, 250, NAN), 0.2));
}

}  // namespace
}  // namespace pagesweep
