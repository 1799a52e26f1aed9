// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/surfacing/find_items.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "pagesweep/surfacing/fit_surface.h"
#include "pagesweep/surfacing/scenes_for_tests.h"

namespace pagesweep {
namespace {

struct Card {
  double x0, y0, x1, y1;
};
/// Three cards: two in the upper line, of which the right one lies a little higher, and one below.
constexpr Card cards[] = {{-90, 20, -10, 80}, {15, 28, 85, 88}, {-60, -80, 40, -25}};

const Card* card_at(double x, double y) {
  for (const Card& card : cards)
    if (x > card.x0 && x < card.x1 && y > card.y0 && y < card.y1) return &card;
  return nullptr;
}

TEST(FindItems, EachSheetIsAPageInReadingOrder) {
  const sim::AnalyticScene scene{[](double x, double y) { return card_at(x, y) ? 2.0 : 0.0; }, 20, -5};
  scenes::Measuring how;
  how.brightness = [](double x, double y) { return card_at(x, y) ? 100.0 : 8.0; };
  const auto points = scenes::measure(scene, how);
  SurfaceOptions options;
  options.layout = Layout::items;
  const std::vector<PageSurface> pages = fit_surface(points, options);
  ASSERT_EQ(pages.size(), 3u);
  for (int k = 0; k < 3; ++k) {
    const PageSurface& page = pages[static_cast<std::size_t>(k)];
    const Card& card = cards[k];
    EXPECT_EQ(page.index, k + 1);
    EXPECT_FALSE(page.gutter_at_left || page.gutter_at_right);
    // (0, 0) is the upper left corner of what was measured: a cell of the field beside the card's.
    const Eigen::Vector3d corner = interpolate(page, page.measured, 0, 0);
    EXPECT_NEAR(corner.x(), card.x0, 4);
    EXPECT_NEAR(corner.y(), card.y1, 4);
    EXPECT_NEAR((page.columns() - 1) * page.spacing_mm - 16, card.x1 - card.x0, 7);
  }
}

TEST(FindItems, ASheetThatLiesAskewStandsUpright) {
  constexpr double angle = 0.5, width = 100, height = 60;  // turned counterclockwise, as seen from above
  const auto is_card = [](double x, double y) {
    const Eigen::Vector2d place = Eigen::Rotation2Dd(-angle) * Eigen::Vector2d(x - 10, y + 5);
    return std::abs(place.x()) < width / 2 && std::abs(place.y()) < height / 2;
  };
  const sim::AnalyticScene scene{[&](double x, double y) { return is_card(x, y) ? 2.0 : 0.0; }, 20, -5};
  scenes::Measuring how;
  how.brightness = [&](double x, double y) { return is_card(x, y) ? 100.0 : 8.0; };
  const auto points = scenes::measure(scene, how);
  SurfaceOptions options;
  options.layout = Layout::items;
  const std::vector<PageSurface> pages = fit_surface(points, options);
  ASSERT_EQ(pages.size(), 1u);
  const PageSurface& page = pages[0];
  // Cells of some millimetres tell the angle roughly; the page's edges in the picture do the rest.
  EXPECT_NEAR(page.turned_rad, -angle, 0.05);
  EXPECT_NEAR((page.columns() - 1) * page.spacing_mm - 16, width, 9);
  EXPECT_NEAR((page.rows() - 1) * page.spacing_mm - 16, height, 9);

  options.straighten = false;
  EXPECT_EQ(fit_surface(points, options).at(0).turned_rad, 0);
}

TEST(FindItems, SmallThingsAreNone) {
  const sim::AnalyticScene scene{[](double, double) { return 0.0; }, 20, -5};
  const auto points = scenes::measure(scene, {});
  const HeightField field = smooth_points(points, {});
  Image<std::uint8_t> paper(field.columns(), field.rows(), 0);
  const int side = static_cast<int>(15 / field.cell_mm);
  for (int j = 10; j < 10 + side; ++j)
    for (int i = 10; i < 10 + side; ++i) paper(i, j) = 1;
  EXPECT_TRUE(find_items(field, paper).empty());
}

}  // namespace
}  // namespace pagesweep
