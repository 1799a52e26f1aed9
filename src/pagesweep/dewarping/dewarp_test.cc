// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/dewarping/dewarp.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "pagesweep/base/error.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/dewarping/page_frame.h"
#include "pagesweep/dewarping/printed_page_testing.h"

namespace pagesweep {
namespace {

constexpr double dot_pitch_mm = 8, dot_sigma_mm = 0.6;
const PageFrame paper{{-44, -36}, 0, 88, 72};

/// Dark dots with Gaussian flanks every 8 mm on bright paper on a dark table.
double dots(double s, double t) {
  if (!paper.contains({s, t})) return 0.12;
  const Eigen::Vector2d at = paper.page_from_paper({s, t});
  const auto from_dot = [](double x) { return x - dot_pitch_mm * (std::floor(x / dot_pitch_mm) + 0.5); };
  const double distance = std::hypot(from_dot(at.x()), from_dot(at.y())) / dot_sigma_mm;
  return 0.85 - 0.7 * std::exp(-0.5 * distance * distance);
}

bool is_inside(const Picture& page, int x, int y) { return x >= 0 && y >= 0 && x < page.width() && y < page.height(); }

/// Centre of gravity [px] of the dark within 2.6 mm of a place.
Eigen::Vector2d centroid(const Picture& page, const Eigen::Vector2d& near_px) {
  const double reach = 2.6 * page.pixels_per_mm;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero(), center = near_px;
  for (int round = 0; round < 3; ++round) {
    double weight = 0;
    sum.setZero();
    for (int y = int(center.y() - reach); y <= int(center.y() + reach) + 1; ++y)
      for (int x = int(center.x() - reach); x <= int(center.x() + reach) + 1; ++x) {
        if ((Eigen::Vector2d(x, y) - center).norm() > reach || !is_inside(page, x, y)) continue;
        const double w = std::max(0.0, 0.84 - pixel_at(page, x, y));
        weight += w;
        sum += w * Eigen::Vector2d(x, y);
      }
    if (!(weight > 0)) return Eigen::Vector2d::Constant(NAN);
    center = sum / weight;
  }
  return center;
}

/// Distances [mm] of all dots from where they were printed, after removal of their mean: rms and largest.
std::pair<double, double> dot_errors(const Page& page) {
  std::vector<Eigen::Vector2d> errors;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  const double scale = page.picture.pixels_per_mm;
  for (double y = dot_pitch_mm / 2; y < paper.height_mm; y += dot_pitch_mm)
    for (double x = dot_pitch_mm / 2; x < paper.width_mm; x += dot_pitch_mm) {
      const Eigen::Vector2d printed_px = Eigen::Vector2d(x, y) * scale - Eigen::Vector2d::Constant(0.5);
      errors.push_back((centroid(page.picture, printed_px) - printed_px) / scale);
      mean += errors.back();
    }
  mean /= double(errors.size());
  double squares = 0, largest = 0;
  for (const Eigen::Vector2d& error : errors) {
    squares += (error - mean).squaredNorm();
    largest = std::max(largest, (error - mean).norm());
  }
  return {std::sqrt(squares / double(errors.size())), largest};
}

/// A dotted page, its scan and its surface.
struct Dotted {
  PageSurface surface;
  Picture scan;
  Scanner scanner;

  Dotted(const Sheet& model, const Sheet& measured, const Scanner& seen_by, int channels = 1, int bit_depth = 8)
      : surface(make_surface(model, measured, {-50, -42}, {50, 42})),
        scan(render_scan(measured, seen_by, dots, 2, channels, bit_depth)),
        scanner(seen_by) {
    scan.pixels_per_mm = 4;
  }
  Page page(const DewarpOptions& options = {}) const { return dewarp({&surface, 1}, scan, scanner, options).at(0); }
};

std::vector<std::pair<std::string, Scanner>> scanners() { return make_small_scanners(4, 440, 380); }

TEST(Dewarp, DotsComeOutWhereTheyWerePrinted) {
  for (const auto& [name, scanner] : scanners())
    for (const Sheet& sheet : {tilted_plane(0.25), cylinder(80, 30)}) {
      const Page page = Dotted(sheet, sheet, scanner).page();
      const auto [rms, largest] = dot_errors(page);
      EXPECT_LT(largest, 0.02) << name;
      EXPECT_NEAR(page.picture.width() / page.picture.pixels_per_mm, paper.width_mm, 0.3) << name;
      EXPECT_NEAR(page.picture.height() / page.picture.pixels_per_mm, paper.height_mm, 0.3) << name;
      EXPECT_NEAR(page.deskew_rad, 0, 3e-4) << name;
    }
}

TEST(Dewarp, TheDifferenceVectorFlattensADent) {
  // Fig. 6 of the paper: a dent of 3 mm, 40 mm beside the middle of a view from 700 mm, moves the print by up to
  // 3 * 40 / 660 = 0.18 mm. Distances along the model and along the dent differ by the slope's square, which the
  // printed dots share here: their paper coordinates are the model's.
  const Sheet model = cylinder(120, 30), measured = dented(model, 3, 9, {30, 5});
  for (const auto& [name, scanner] : scanners()) {
    const Dotted dotted(model, measured, scanner);
    EXPECT_LT(dot_errors(dotted.page()).second, 0.02) << name;
    EXPECT_GT(dot_errors(dotted.page({.difference_vector = false})).second, 0.1) << name;
  }
}

TEST(Dewarp, ResolutionIsTheScansOwnOrTheOneAskedFor) {
  const Sheet sheet = tilted_plane(0, 40);
  Dotted dotted(sheet, sheet, scanners()[0].second, 3, 16);
  dotted.scan.icc_profile = {std::byte{7}};
  EXPECT_EQ(dotted.page().picture.pixels_per_mm, 4);
  const Page asked = dotted.page({.dpi = 100});
  EXPECT_DOUBLE_EQ(asked.picture.pixels_per_mm, 100 / 25.4);
  EXPECT_EQ(asked.picture.channels, 3);
  EXPECT_EQ(asked.picture.bit_depth(), 16);
  EXPECT_EQ(asked.picture.icc_profile, dotted.scan.icc_profile);
  EXPECT_EQ(asked.scan_map.width(), asked.picture.width());
  EXPECT_LT(dot_errors(asked).second, 0.02);
  dotted.scan.pixels_per_mm = 0;
  EXPECT_NEAR(dotted.page().picture.pixels_per_mm, 4, 0.02);  // 101 or 102 dpi
  const double dpi = dotted.page().picture.pixels_per_mm * 25.4;
  EXPECT_NEAR(dpi, std::round(dpi), 1e-9);
}

TEST(Dewarp, CountsTheShareThatWasMeasured) {
  const Sheet sheet = tilted_plane(0);
  Dotted dotted(sheet, sheet, scanners()[1].second);
  EXPECT_EQ(dotted.page().measured_share, 1);
  for (int j = 0; j < dotted.surface.rows(); ++j)
    for (int i = 0; i < dotted.surface.columns(); ++i)
      if (dotted.surface.t_of(j) > 0) dotted.surface.status(i, j) = PixelStatus::too_dark;
  EXPECT_NEAR(dotted.page().measured_share, 0.5, 0.03);
}

/// Keeps what it is told.
struct Listener : Progress {
  void warn(std::string_view message) override { warnings.emplace(message); }
  std::set<std::string> warnings;
};

TEST(Dewarp, WarnsOfEdgesThatAreNotSeen) {
  const Sheet sheet = tilted_plane(0);
  const Dotted dotted(sheet, sheet, scanners()[1].second);
  Listener clean, blind;
  dewarp({&dotted.surface, 1}, dotted.scan, dotted.scanner, {}, clean);
  EXPECT_TRUE(clean.warnings.empty());
  Picture white = make_picture(dotted.scan.width(), dotted.scan.height(), 1, 8);
  dewarp({&dotted.surface, 1}, white, dotted.scanner, {}, blind);
  EXPECT_EQ(blind.warnings.size(), 4u);
}

TEST(Dewarp, BothPagesOfASpreadEndAtTheGutter) {
  // Two pages that dip into the gutter at x = 0 with 45 degrees.
  const double radius = 60, slope = 0.25 * 3.14159265358979;
  const Sheet right = [=](double s, double t) {
    const double a = slope - s / radius;
    return Eigen::Vector3d(radius * (std::sin(slope) - std::sin(a)), -t, radius * (std::cos(a) - std::cos(slope)));
  };
  const Sheet left = [=](double s, double t) {
    const Eigen::Vector3d mirrored = right(-s, t);
    return Eigen::Vector3d(-mirrored.x(), mirrored.y(), mirrored.z());
  };
  const Sheet spread = [=](double s, double t) { return s < 0 ? left(s, t) : right(s, t); };
  std::vector<PageSurface> surfaces{make_surface(left, left, {-50, -42}, {0, 42}),
                                    make_surface(right, right, {0, -42}, {50, 42})};
  surfaces[0].gutter_at_right = surfaces[1].gutter_at_left = true;
  surfaces[1].index = 2;
  for (const auto& [name, scanner] : scanners()) {
    const Picture scan = render_scan(spread, scanner, dots, 2);
    const std::vector<Page> pages = dewarp(surfaces, scan, scanner, {.dpi = 120});
    ASSERT_EQ(pages.size(), 2u);
    for (const Page& page : pages) {
      EXPECT_EQ(page.index, &page == &pages[0] ? 1 : 2);
      EXPECT_NEAR(page.picture.width() / page.picture.pixels_per_mm, paper.width_mm / 2, 0.3) << name;
      EXPECT_NEAR(page.deskew_rad, 0, 5e-4) << name;
    }
    // The first whole dots beside the gutter are a pitch away from it.
    const double scale = pages[1].picture.pixels_per_mm;
    const Eigen::Vector2d printed_px = Eigen::Vector2d(8, 36) * scale - Eigen::Vector2d::Constant(0.5);
    EXPECT_NEAR(centroid(pages[1].picture, printed_px).x(), printed_px.x(), 0.03 * scale) << name;
  }
}

TEST(Dewarp, RefusesWhatDoesNotFitTogether) {
  const Sheet sheet = tilted_plane(0);
  const Dotted dotted(sheet, sheet, scanners()[1].second);
  const std::span<const PageSurface> surfaces(&dotted.surface, 1);
  EXPECT_THROW(dewarp(surfaces, make_picture(5, 5, 1, 8), dotted.scanner), std::invalid_argument);
  for (const double dpi : {-1.0, 5.0, 1e9, double(NAN)})
    EXPECT_THROW(dewarp(surfaces, dotted.scan, dotted.scanner, {.dpi = dpi}), std::invalid_argument);
  EXPECT_THROW(dewarp(surfaces, dotted.scan, dotted.scanner, {.margin_mm = NAN}), std::invalid_argument);
  EXPECT_THROW(dewarp(surfaces, dotted.scan, dotted.scanner, {.margin_mm = -60}), Error);
  EXPECT_TRUE(dewarp({}, dotted.scan, dotted.scanner).empty());
}

TEST(Dewarp, DoesNotDependOnTheNumberOfThreads) {
  const Sheet sheet = cylinder(80, 30);
  const Dotted dotted(sheet, sheet, scanners()[2].second);
  const auto samples = [&] { return std::get<Image<std::uint8_t>>(dotted.page().picture.samples); };
  const auto many = samples();
  const ThreadLimit limit(1);
  const auto one = samples();
  EXPECT_TRUE(std::equal(many.pixels().begin(), many.pixels().end(), one.pixels().begin(), one.pixels().end()));
}

}  // namespace
}  // namespace pagesweep
