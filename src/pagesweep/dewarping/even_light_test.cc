// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/dewarping/even_light.h"

#include <gtest/gtest.h>

#include <cmath>

#include "pagesweep/data/transfer_curve.h"
#include "pagesweep/dewarping/dewarp.h"
#include "pagesweep/dewarping/gutter_glow.h"
#include "pagesweep/dewarping/printed_page_testing.h"

namespace pagesweep {
namespace {

constexpr double paper_albedo = 0.7;

/// The bar's light on a spot by plain summation over pieces of the bar: the witness of the closed form.
double summed_light(const LampBar& bar, const Eigen::Vector3d& point, const Eigen::Vector3d& normal) {
  constexpr int pieces = 4000;
  double sum = 0;
  for (int k = 0; k < pieces; ++k) {
    const double x = bar.center_mm + ((k + 0.5) / pieces - 0.5) * bar.length_mm;
    const Eigen::Vector3d arm = Eigen::Vector3d(x, point.y(), bar.height_mm) - point;
    const double emitted = (bar.height_mm - point.z()) / arm.norm();
    sum += normal.dot(arm.normalized()) * emitted / arm.squaredNorm() * bar.length_mm / pieces;
  }
  return sum;
}

TEST(LampLight, TheClosedFormIsTheSumOverTheBar) {
  const LampBar bar{500, 420, 15};
  const ScanLight light{.lamp = bar};
  const LampLight lamp(light);
  const Eigen::Vector3d reference(30, 20, 0);
  for (const double slope : {-0.9, -0.2, 0.0, 0.6})
    for (const double x : {-140.0, -20.0, 90.0}) {
      const Eigen::Vector3d point(x, 25, 33), normal = Eigen::Vector3d(-slope, 0.1, 1).normalized();
      EXPECT_NEAR(lamp.at(point, normal, reference),
                  summed_light(bar, point, normal) / summed_light(bar, reference, Eigen::Vector3d::UnitZ()), 1e-5);
    }
}

TEST(LampLight, WithoutABarTheLightComesFromAfar) {
  const ScanLight light;
  const Eigen::Vector3d point(50, 0, 40), tilted = Eigen::Vector3d(1, 0, 1).normalized();
  EXPECT_NEAR(LampLight(light).at(point, tilted, point), std::sqrt(0.5), 1e-12);
}

TEST(GutterGlow, TheLitShareOfAStripIsTheIntegralOverIt) {
  EXPECT_NEAR(lit_share(1e-6, 5), 1, 1e-6);
  for (const double distance : {2.0, 7.0, 40.0}) {
    const double sigma = 5;
    double lit = 0, all = 0;
    for (double y = -2000; y < 2000; y += 0.02) {
      const double sent = 1 / std::pow(distance * distance + y * y, 2);
      lit += sent * std::exp(-0.5 * y * y / (sigma * sigma));
      all += sent;
    }
    EXPECT_NEAR(lit_share(distance, sigma), lit / all, 0.004);
  }
}

/// Two level sheets that fall off into a gutter at x = 0 by an angle, like an open book's pages.
Sheet falling(double angle_rad, double side) {
  return [=](double s, double t) {
    return Eigen::Vector3d(s * std::cos(angle_rad), -t, 5 + side * s * std::sin(angle_rad));
  };
}

struct Wedge {
  std::vector<PageSurface> surfaces;
  explicit Wedge(double angle_rad) {
    const Sheet left = falling(angle_rad, -1), right = falling(angle_rad, 1);
    surfaces = {make_surface(left, left, {-60, -42}, {0, 42}), make_surface(right, right, {0, -42}, {60, 42})};
    surfaces[0].gutter_at_right = surfaces[1].gutter_at_left = true;
    surfaces[1].index = 2;
  }
};

TEST(GutterGlow, IsThatOfAWedgeInClosedForm) {
  // A spot in a wedge with straight sides of equal light sees the facing side from angle p0 = 90 degrees to the one
  // under which its end appears: (1 - sin p) / 2 of its light, if the stripe is wide.
  const double angle = 0.7;
  const Wedge wedge(angle);
  const Scanner scanner = make_small_scanners(3, 420, 480)[1].second;
  Picture white = make_picture(420, 480, 3, 8);
  for (int y = 0; y < 480; ++y)
    for (int x = 0; x < 420; ++x) set_pixel(white, x, y, 1);
  const PaperView left(wedge.surfaces[0], scanner, PaperShape::measured);
  const PaperView right(wedge.surfaces[1], scanner, PaperShape::measured);
  ScanLight light;
  light.stripe_fwhm_mm = 1e5;
  const GutterGlow glow(right, left, white, light);
  const Eigen::Vector3d normal = Eigen::Vector3d(-std::sin(angle), 0, std::cos(angle));
  for (const double s : {1.0, 5.0, 20.0, 50.0}) {
    const Eigen::Vector3d point = right.point({s, 3}), end = left.point({-60, 3});
    const double sine = normal.cross((end - point).normalized()).norm();
    EXPECT_NEAR(glow.at({s, 3}, point, normal)[1], 0.5 * (1 - sine), 0.01) << s;
  }
}

/// The scan of paper that is lit by a bar, as a scanner shows it that has evened out the light on its table.
Picture scan_lit(const Sheet& sheet, const Scanner& scanner, const ScanLight& light,
                 const std::function<double(double s, double t)>& albedo) {
  const LampLight lamp(light);
  const TransferCurve srgb;
  Picture scan = render_scan(sheet, scanner, [&](double s, double t) {
    const double h = 1e-3;
    const Eigen::Vector3d point = sheet(s, t);
    const Eigen::Vector3d normal =
        (sheet(s, t + h) - sheet(s, t - h)).cross(sheet(s + h, t) - sheet(s - h, t)).normalized();
    const auto pixel = scanner.project(point);
    const auto ray = scanner.ray(*pixel);
    const Eigen::Vector3d reference = ray->origin - ray->origin.z() / ray->direction.z() * ray->direction;
    return srgb.sample(albedo(s, t) * lamp.at(point, normal.z() > 0 ? normal : -normal, reference));
  });
  scan.pixels_per_mm = 4;
  return scan;
}

/// Light of the page, by its place: mean over 3 x 3 pixels.
double light_at(const Page& page, double x_mm, double y_mm) {
  const TransferCurve srgb;
  const int x = static_cast<int>(x_mm * page.picture.pixels_per_mm);
  const int y = static_cast<int>(y_mm * page.picture.pixels_per_mm);
  double sum = 0;
  for (int j = -1; j <= 1; ++j)
    for (int i = -1; i <= 1; ++i) sum += srgb.light(pixel_at(page.picture, x + i, y + j)) / 9;
  return sum;
}

struct Lit {
  static constexpr double width = 88, height = 72;
  PageSurface surface;
  Scanner scanner = make_small_scanners(4, 440, 380)[1].second;
  Picture scan;

  Lit(const Sheet& sheet, const ScanLight& light)
      : surface(make_surface(sheet, sheet, {-50, -42}, {50, 42})),
        scan(scan_lit(sheet, scanner, light, [](double s, double t) {
          if (std::abs(s) > 44 || std::abs(t) > 36) return 0.03;
          return s > 10 && s < 30 && t > 0 && t < 20 ? 0.2 : paper_albedo;  // a dark field of print
        })) {}
  Page page(Shading shading, const ScanLight& light = {}) const {
    return dewarp({&surface, 1}, scan, scanner, {.shading = shading}, no_progress(), light).at(0);
  }
  /// Largest relative difference of paper from its albedo, and of the dark field from its own.
  static std::pair<double, double> errors(const Page& page) {
    double paper = 0, dark = 0;
    for (double y = 4; y < height - 3; y += 4)
      for (double x = 4; x < width - 3; x += 4) {
        const bool is_dark = x > 52 && x < 76 && y > 34 && y < 58;
        const bool near_border = is_dark && !(x > 56 && x < 72 && y > 38 && y < 54);
        if (near_border) continue;
        const double albedo = is_dark ? 0.2 : paper_albedo;
        (is_dark ? dark : paper) = std::max(is_dark ? dark : paper, std::abs(light_at(page, x, y) / albedo - 1));
      }
    return {paper, dark};
  }
};

TEST(EvenLight, SlopeAndDistanceAreDividedOutAndPrintIsKept) {
  const ScanLight light{.lamp = LampBar{350, 400, 0}};
  const Lit lit(cylinder(70, 20), light);  // up to 36 degrees steep, over 13 mm of height
  const auto [before, before_dark] = Lit::errors(lit.page(Shading::keep));
  const Page even = lit.page(Shading::even, light);
  EXPECT_NEAR(even.picture.width() / even.picture.pixels_per_mm, Lit::width, 0.3);
  EXPECT_NEAR(even.picture.height() / even.picture.pixels_per_mm, Lit::height, 0.3);
  const auto [after, after_dark] = Lit::errors(even);
  EXPECT_GT(before, 0.15);
  // A gray value of 8 bit is 0.9 % of the paper's light and 2 % of the dark field's.
  EXPECT_LT(after, 0.015);
  EXPECT_LT(after_dark, 0.025);
}

TEST(EvenLight, TheLampIsFoundFromThePaperIfTheRigDoesNotKnowIt) {
  const Lit lit(cylinder(70, 20), {.lamp = LampBar{350, 400, 0}});
  const Page page = lit.page(Shading::even);
  double low = 1e9, high = 0;
  for (double y = 4; y < 30; y += 4)
    for (double x = 6; x < Lit::width - 5; x += 4) {
      low = std::min(low, light_at(page, x, y));
      high = std::max(high, light_at(page, x, y));
    }
  // Before it is 0.65. Lamps are tried in steps, and this page is too small to tell its length: 2 %; rounding: 1 %.
  EXPECT_GT(low / high, 0.96);
}

TEST(EvenLight, ThePaperShowsHowMuchOfTheLightIsAmbient) {
  for (const double ambient : {0.4, 1.0}) {
    const Lit lit(cylinder(70, 20), {.lamp = LampBar{350, 400, 0}, .ambient = ambient});
    const auto [paper, dark] = Lit::errors(lit.page(Shading::even, {.lamp = LampBar{350, 400, 0}}));
    EXPECT_LT(paper, 0.015) << ambient;
    EXPECT_LT(dark, 0.025) << ambient;
  }
}

TEST(EvenLight, APictureWithoutShadingGetsNone) {
  const Lit lit(cylinder(70, 20), {.ambient = 1});
  const auto [paper, dark] = Lit::errors(lit.page(Shading::even));
  EXPECT_LT(paper, 0.015);
  EXPECT_LT(dark, 0.025);
}

TEST(EvenLight, ALevelPageStaysAsItIsToTheLastBit) {
  const Lit lit(tilted_plane(0, 3), {});
  const auto samples = [&](Shading shading) {
    return std::get<Image<std::uint8_t>>(lit.page(shading).picture.samples);
  };
  const auto kept = samples(Shading::keep), even = samples(Shading::even);
  EXPECT_TRUE(std::equal(kept.pixels().begin(), kept.pixels().end(), even.pixels().begin(), even.pixels().end()));
}

TEST(EvenLight, TheWhiteReferenceEvensOutTheScannersOwnField) {
  const Sheet sheet = tilted_plane(0, 0);
  Lit lit(sheet, {});
  const TransferCurve srgb;
  ScanLight light;
  light.white = WhiteReference{0, 2, 2, {{0.5f, 0.5f, 0.5f}, {1, 1, 1}, {0.5f, 0.5f, 0.5f}, {1, 1, 1}}};
  for (int y = 0; y < lit.scan.height(); ++y)
    for (int x = 0; x < lit.scan.width(); ++x) {
      const double field = 0.5 + 0.5 * x / (lit.scan.width() - 1);
      set_pixel(lit.scan, x, y, srgb.sample(field * srgb.light(pixel_at(lit.scan, x, y))));
    }
  const Page page = lit.page(Shading::even, light);
  EXPECT_NEAR(light_at(page, 8, 10), 0.75 * paper_albedo, 0.01);
  EXPECT_NEAR(light_at(page, 80, 10), 0.75 * paper_albedo, 0.01);
}

TEST(EvenLight, KeepsTheProfileAndTheFillColour) {
  Lit lit(cylinder(70, 20), {});
  lit.scan.icc_profile = {std::byte{1}, std::byte{2}};
  const Page page = lit.page(Shading::even);
  EXPECT_EQ(page.picture.icc_profile, lit.scan.icc_profile);
}

}  // namespace
}  // namespace pagesweep
