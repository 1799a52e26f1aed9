// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/quality/page_quality.h"

#include <gtest/gtest.h>

#include <cmath>

#include "pagesweep/quality/line_straightness.h"
#include "pagesweep/quality/quality_page_testing.h"
#include "pagesweep/quality/standards.h"

namespace pagesweep {
namespace {

constexpr double pixels_per_mm = 300 / 25.4;

/// Lines of letters, 6 mm apart, whose baselines follow a curve.
double text(double x, double y, const std::function<double(double x_mm)>& baseline_mm) {
  const double x_mm = x / pixels_per_mm, y_mm = y / pixels_per_mm - baseline_mm(x_mm);
  const double line = std::fmod(y_mm, 6), letter = std::fmod(x_mm + 0.37 * std::floor(y_mm / 6), 1.9);
  const bool is_inside = x_mm > 8 && x_mm < 122 && y_mm > 6 && y_mm < 70;
  // Soft lower edges, as a lens makes them: the baseline lies between pixels.
  const double below = std::clamp((4 - line) * pixels_per_mm + 0.5, 0.0, 1.0);
  return is_inside && line > 2 && line < 5 && letter < 1.2 ? 0.8 - 0.75 * below : 0.8;
}

TEST(LineStraightness, MeasuresTheBendOfLines) {
  const auto measure = [](double height_mm) {
    const auto bend = [=](double x_mm) { return height_mm * std::sin(2 * M_PI * x_mm / 90); };
    const Page page = make_test_page(1540, 900, [&](double x, double y) { return text(x, y, bend); }, 1);
    return measure_lines(light_of_page(page), pixels_per_mm);
  };
  const LineStraightness straight = measure(0), bent = measure(0.3);
  EXPECT_GE(straight.lines, 8);
  EXPECT_LT(straight.rms_mm, 0.03);
  EXPECT_LT(straight.largest_in_100_mm, 0.04);
  // A sine of 0.3 mm less its best straight line.
  EXPECT_NEAR(bent.rms_mm, 0.3 / std::sqrt(2.0), 0.06);
  EXPECT_NEAR(bent.largest_in_100_mm, 0.3, 0.12);
}

TEST(LineStraightness, TellsHowLinesAreTurned) {
  const Page page =
      make_test_page(1540, 900, [](double x, double y) { return text(x, y, [](double x_mm) { return 0.01 * x_mm; }); });
  EXPECT_NEAR(measure_lines(light_of_page(page), pixels_per_mm).skew_rad, 0.01, 0.0005);
}

TEST(PaperLook, MeasuresNoiseUniformityAndClipping) {
  // Light falls from 0.7 to 0.63 along x; sRGB's noise of 2 gray values at L* 85 is 2 / 255 times dL*/dsample.
  const Page page = make_test_page(900, 700, [](double x, double) { return 0.7 - 0.07 * x / 900; }, 2);
  const PaperLook look = look_at_paper(page, light_of_page(page));
  EXPECT_NEAR(look.non_uniformity, 0.1 * 0.93, 0.02);
  const TransferCurve srgb;
  const double sample = srgb.sample(0.665), step = 1e-3;
  const auto l_star = [&](double s) { return 116 * std::cbrt(srgb.light(s)) - 16; };
  const double noise = 2.02 / 255 * (l_star(sample + step) - l_star(sample - step)) / (2 * step);  // with rounding
  EXPECT_NEAR(look.noise_l_star, noise, 0.05 * noise);
  EXPECT_EQ(look.clipped_white, 0);
  const Page bright = make_test_page(900, 700, [](double x, double) { return x < 90 ? 1.0 : 0.7; });
  EXPECT_NEAR(look_at_paper(bright, light_of_page(bright)).clipped_white, 0.1, 0.002);
}

TEST(ResolutionMap, IsTheScansOwnInBothDirections) {
  const Page page = make_test_page(600, 480, [](double, double) { return 0.8; }, 0, 0.6);
  const ResolutionMap map = map_resolution(page);
  EXPECT_NEAR(map.lowest_across_dpi, 180, 0.1);
  EXPECT_NEAR(map.typical_down_dpi, 300, 0.1);
  EXPECT_EQ(map.across_dpi.width(), 600 / 59);
}

TEST(Standards, AFigureReachesTheLevelWhoseLimitItKeeps) {
  EXPECT_EQ(fadgi_level("sampling_efficiency_across", 92), "4 stars");
  EXPECT_EQ(fadgi_level("sampling_efficiency_across", 61), "1 star");
  EXPECT_EQ(fadgi_level("sampling_efficiency_across", 40), "below 1 star");
  EXPECT_EQ(iso_level("noise", 1.5), "A");
  EXPECT_EQ(iso_level("noise", 3), "below C");
  EXPECT_EQ(fadgi_level("non_uniformity", 30), "1 star");
  EXPECT_EQ(fadgi_level("scale_error_down", -1.5), "3 stars");
  EXPECT_EQ(iso_level("scale_error_down", 0), "");
  EXPECT_EQ(fadgi_level("line_straightness", 0.1), "");
  EXPECT_EQ(fadgi_level("noise", std::nan("")), "");
}

/// A level surface below a page of that size.
PageSurface level_surface(const Page& page, double stretch = 1) {
  PageSurface surface;
  const int columns = static_cast<int>(page.picture.width() / page.picture.pixels_per_mm / 2) + 1;
  const int rows = static_cast<int>(page.picture.height() / page.picture.pixels_per_mm / 2) + 1;
  surface.model = Image<Eigen::Vector3f>(columns, rows, Eigen::Vector3f::Zero());
  for (int j = 0; j < rows; ++j)
    for (int i = 0; i < columns; ++i)
      surface.model(i, j) = {float(stretch * surface.s_of(i)), float(-surface.t_of(j)), 0};
  surface.measured = surface.model;
  surface.status = Image<PixelStatus>(columns, rows, PixelStatus::ok);
  return surface;
}

PageQuality quality_of(const Page& page, double stretch = 1) {
  return measure_quality(page, level_surface(page, stretch), PictureLight(page.picture), ResampleKernel::lanczos3);
}

TEST(PageQuality, AGoodPageIsGood) {
  const Page page = make_test_page(900, 700, [](double, double) { return 0.75; }, 0.5);
  const PageQuality quality = quality_of(page);
  EXPECT_EQ(quality.verdict, PageVerdict::good) << (quality.reasons.empty() ? "" : quality.reasons[0]);
  EXPECT_TRUE(quality.reasons.empty());
  EXPECT_NEAR(quality.value("scale_error_across"), 0, 1e-4);
  EXPECT_TRUE(std::isnan(quality.value("mtf10_across")));  // nothing is printed
}

TEST(PageQuality, SaysWhatIsWrongAndHowMuch) {
  const auto level = [](double, double) { return 0.75; };
  EXPECT_EQ(quality_of(make_test_page(900, 700, level, 0.5), 1.02).verdict, PageVerdict::look);
  EXPECT_EQ(quality_of(make_test_page(900, 700, level, 0.5), 1.08).verdict, PageVerdict::scan_again);
  const PageQuality bright = quality_of(make_test_page(900, 700, [](double, double) { return 1.0; }));
  EXPECT_EQ(bright.verdict, PageVerdict::scan_again);
  ASSERT_FALSE(bright.reasons.empty());
  EXPECT_NE(bright.reasons[0].find("overexposed"), std::string::npos);
  const PageQuality squeezed = quality_of(make_test_page(900, 700, level, 0.5, 0.5));
  EXPECT_EQ(squeezed.verdict, PageVerdict::look);  // 150 dpi
  Page hidden = make_test_page(900, 700, level, 0.5);
  for (int y = 0; y < 700; ++y)
    for (int x = 0; x < 300; ++x) hidden.scan_map.u(x, y) = not_a_number;
  EXPECT_EQ(quality_of(hidden).verdict, PageVerdict::scan_again);
}

TEST(PageQuality, BlurredPrintIsToBeScannedAgain) {
  const auto bars = [](double sigma) {
    return make_test_page(700, 600, [=](double x, double) {
      const double offset = 40.37 * std::floor(x / 40.37) + 10;
      return blurred_bar(x, offset, offset + 18, sigma);
    });
  };
  EXPECT_EQ(quality_of(bars(0.6)).verdict, PageVerdict::good);
  EXPECT_GT(quality_of(bars(0.6)).value("sampling_efficiency_across"), 85);
}

}  // namespace
}  // namespace pagesweep
