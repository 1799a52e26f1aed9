// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/dewarping/paper_mask.h"

#include <gtest/gtest.h>

#include <cmath>

#include "pagesweep/dewarping/dewarp.h"
#include "pagesweep/dewarping/printed_page_testing.h"

namespace pagesweep {
namespace {

const PageFrame paper{{-44, -36}, 0, 88, 72};
constexpr double finger_x = 0, finger_y = 40, finger_radius = 9;  // on the page's left margin
constexpr double torn = 15;                                       // sides of the missing corner

/// Gray paper with a finger on its margin, a torn corner at the lower right, and dark print in the middle.
struct Marred {
  PageSurface surface;
  Picture scan;
  Scanner scanner = make_small_scanners(4, 440, 380)[1].second;

  /// \param with_shadow  below the finger, 3 mm wide, softly ending
  explicit Marred(bool with_shadow = false) {
    const Sheet sheet = tilted_plane(0, 5);
    surface = make_surface(sheet, sheet, {-50, -42}, {50, 42});
    const double shadow_mm = with_shadow ? 3 : 0;
    for (int j = 0; j < surface.rows(); ++j)
      for (int i = 0; i < surface.columns(); ++i) {
        const Eigen::Vector2d at = paper.page_from_paper({surface.s_of(i), surface.t_of(j)});
        if (is_finger(at)) surface.status(i, j) = PixelStatus::covered;
        // The measurement reaches a little beyond the tear.
        if (!paper.contains({surface.s_of(i), surface.t_of(j)}) || is_torn(at + Eigen::Vector2d(-1, -1)))
          surface.status(i, j) = PixelStatus::off_surface;
      }
    scan = render_scan(sheet, scanner, [shadow_mm](double s, double t) {
      const Eigen::Vector2d at = paper.page_from_paper({s, t});
      if (is_finger(at)) return 0.45;
      if (!paper.contains({s, t}) || is_torn(at)) return 0.1;
      const double beyond_mm = std::hypot(at.x() - finger_x, at.y() - finger_y) - finger_radius;
      if (beyond_mm < shadow_mm) return 0.75 - 0.2 * (1 - beyond_mm / shadow_mm);
      return at.x() > 30 && at.x() < 50 && at.y() > 20 && at.y() < 50 ? 0.15 : 0.75;
    });
    scan.pixels_per_mm = 4;
  }
  static bool is_finger(const Eigen::Vector2d& at) {
    return std::hypot(at.x() - finger_x, at.y() - finger_y) < finger_radius;
  }
  static bool is_torn(const Eigen::Vector2d& at) {
    return (paper.width_mm - at.x()) + (paper.height_mm - at.y()) < torn;
  }
  Page page(const DewarpOptions& options) const { return dewarp({&surface, 1}, scan, scanner, options).at(0); }
};

double at(const Page& page, double x_mm, double y_mm) {
  return pixel_at(page.picture, static_cast<int>(x_mm * 4), static_cast<int>(y_mm * 4));
}
bool is_known(const Page& page, double x_mm, double y_mm) {
  return std::isfinite(page.scan_map.u(static_cast<int>(x_mm * 4), static_cast<int>(y_mm * 4)));
}

TEST(PaperMask, AFingerStaysIsMaskedOrFilledAsAsked) {
  const Marred marred;
  EXPECT_NEAR(at(marred.page({}), 4, 40), 0.45, 0.01);
  const Page masked = marred.page({.obstructions = Obstructions::mask});
  EXPECT_EQ(at(masked, 4, 40), 1);
  const Page filled = marred.page({.obstructions = Obstructions::fill});
  EXPECT_NEAR(at(filled, 4, 40), 0.75, 0.01);
  for (const Page* page : {&masked, &filled}) {
    EXPECT_FALSE(is_known(*page, 4, 40));
    EXPECT_TRUE(is_known(*page, 14, 40));
    EXPECT_NEAR(at(*page, 40, 30), 0.15, 0.01);  // print is left alone
    // Nothing of the finger is left: the rim is masked with it.
    for (double y = 28; y < 53; y += 0.5)
      for (double x = 0.5; x < 14; x += 0.5) EXPECT_GT(at(*page, x, y), 0.7) << x << " " << y;
  }
}

TEST(PaperMask, TheFingersShadowGoesWithItAndNoPrint) {
  const Marred marred(true);
  EXPECT_NEAR(at(marred.page({}), 10, 40), 0.62, 0.04);
  const Page filled = marred.page({.obstructions = Obstructions::fill});
  for (double y = 20; y < 60; y += 0.5)
    for (double x = 0.5; x < 20; x += 0.5) EXPECT_NEAR(at(filled, x, y), 0.75, 0.015) << x << " " << y;
  EXPECT_FALSE(is_known(filled, 11, 40));
  EXPECT_TRUE(is_known(filled, 14, 40));
  EXPECT_NEAR(at(filled, 40, 30), 0.15, 0.01);
  EXPECT_TRUE(is_known(filled, 40, 30));
}

TEST(PaperMask, TheTableInATornCornerIsMaskedButNotPrint) {
  const Marred marred;
  EXPECT_NEAR(at(marred.page({}), 85, 69), 0.1, 0.02);
  const Page page = marred.page({.surroundings = Surroundings::mask});
  EXPECT_EQ(at(page, 85, 69), 1);
  EXPECT_FALSE(is_known(page, 85, 69));
  // Nothing of the table is left along the tear, a line from (88 - 15, 72) to (88, 72 - 15), and the paper stays.
  for (double x = 75; x < 87; x += 0.5) {
    for (double y = 72 - (x - 73) + 0.5; y < 71.5; y += 0.5) EXPECT_EQ(at(page, x, y), 1) << x << " " << y;
    EXPECT_NEAR(at(page, x, 72 - (x - 73) - 1.5), 0.75, 0.01) << x;
  }
  EXPECT_NEAR(at(page, 40, 30), 0.15, 0.01);
  EXPECT_NEAR(at(page, 70, 60), 0.75, 0.01);
}

TEST(PaperMask, NothingIsMaskedOnACleanPage) {
  Marred marred;
  for (PixelStatus& status : marred.surface.status.pixels())
    if (status == PixelStatus::covered) status = PixelStatus::ok;
  EXPECT_TRUE(find_obstructions(marred.surface, paper, marred.page({}).picture).empty());
}

}  // namespace
}  // namespace pagesweep
