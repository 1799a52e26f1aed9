// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/report/pictures.h"

#include <gtest/gtest.h>

#include <cmath>

#include "pagesweep/sim/analytic_scene.h"

namespace pagesweep {
namespace {

/// CIE luminance of an sRGB colour, 0 to 1.
double luminance(Rgb colour) {
  const auto linear = [](double c) { return c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4); };
  return 0.2126 * linear(colour.r / 255.0) + 0.7152 * linear(colour.g / 255.0) + 0.0722 * linear(colour.b / 255.0);
}

TEST(ColourRamp, GrowsEvenlyInPerceivedLightness) {
  // CIE L* = 116 Y^(1/3) - 16 for Y > 0.009: linear in the share, to the rounding of 8 bit.
  for (int i = 0; i <= 20; ++i) {
    const double y = luminance(colour_of(Ramp::sequential, i / 20.0));
    EXPECT_NEAR(116 * std::cbrt(y) - 16, 16 + 76 * i / 20.0, 0.8) << i;
  }
}

TEST(ColourRamp, DeviationsAreEquallyStrongToBothSides) {
  for (const double size : {0.1, 0.25, 0.5})
    EXPECT_NEAR(luminance(colour_of(Ramp::diverging, 0.5 - size)), luminance(colour_of(Ramp::diverging, 0.5 + size)),
                0.02);
  EXPECT_EQ(colour_of(Ramp::diverging, NAN), no_value_colour);
  EXPECT_EQ(colour_of(Ramp::gray, 7), (Rgb{255, 255, 255}));
}

TEST(ColourOfStatus, EveryReasonHasItsOwn) {
  const std::size_t count = names_of(PixelStatus{}).size();
  for (std::size_t a = 0; a < count; ++a)
    for (std::size_t b = 0; b < a; ++b)
      EXPECT_FALSE(colour_of(static_cast<PixelStatus>(a)) == colour_of(static_cast<PixelStatus>(b))) << a << " " << b;
}

TEST(Range, LeavesStrayValuesOut) {
  Image<float> values(100, 100);
  for (std::size_t i = 0; i < values.size(); ++i) values.data()[i] = static_cast<float>(i) / 10000;
  values(3, 3) = 1e9f;
  values(4, 4) = not_a_number;
  EXPECT_NEAR(range_of(values).low, 0.01, 1e-3);
  EXPECT_NEAR(range_of(values).high, 0.99, 1e-3);
  EXPECT_EQ(range_of(Image<float>(5, 5, not_a_number)).high, 1);
}

TEST(Shrink, AveragesWhatIsThere) {
  Image<float> values(4, 4, 2);
  values(0, 0) = not_a_number;
  values(1, 0) = 5;
  const Image<float> small = shrink(values, 2);
  ASSERT_EQ(small.width(), 2);
  EXPECT_FLOAT_EQ(small(0, 0), 3);
  EXPECT_FLOAT_EQ(small(1, 1), 2);

  Picture deep = make_picture(4, 2, 3, 16);
  for (auto& sample : std::get<1>(deep.samples).pixels()) sample = 65535;
  const Picture shallow = shrink(deep, 2);
  EXPECT_EQ(shallow.width(), 2);
  EXPECT_EQ(shallow.height(), 1);
  EXPECT_EQ(std::get<0>(shallow.samples)(5, 0), 255);
}

TEST(HeightField, ShowsTheSurfaceFromAboveWithItsHeights) {
  const Rig rig = sim::make_test_rig(128);
  const sim::AnalyticScene scene{.height = [](double x, double y) {
    return std::abs(x) < 80 && std::abs(y) < 60 ? 20 + 0.1 * x + 0.05 * y : NAN;
  }};
  const std::vector<PointMap> maps{scene.points(rig.cameras[0]), scene.points(rig.cameras[1])};
  const HeightField field = make_height_field(maps, 60);
  EXPECT_TRUE(field.z_is_towards);
  EXPECT_NEAR(field.mm_per_px * field.height.width(), 160, 8);
  EXPECT_NEAR(field.mm_per_px * field.height.height(), 120, 8);
  const int last_x = field.height.width() - 3, last_y = field.height.height() - 3;
  EXPECT_NEAR(field.height(last_x, 2) - field.height(2, 2), 0.1 * field.mm_per_px * (last_x - 2), 0.4);
  EXPECT_GT(field.height(5, 2), field.height(5, last_y)) << "y grows up the picture";
}

TEST(Relief, SlopesToTheLightAreBrighter) {
  HeightField field{Image<float>(41, 41), 1, true};
  for (int y = 0; y < 41; ++y)
    for (int x = 0; x < 41; ++x) field.height(x, y) = 10 - 0.3f * static_cast<float>(std::abs(x - 20));  // a ridge
  const Picture picture = draw_relief(field, {0, 20});
  const auto& bytes = std::get<0>(picture.samples);
  EXPECT_GT(bytes(3 * 12 + 1, 20), bytes(3 * 28 + 1, 20)) << "light comes from the left";
}

TEST(CropToPages, TakesWhatTheMapsName) {
  Picture scan = make_picture(50, 40, 1, 8);
  std::get<0>(scan.samples)(12, 22) = 99;
  std::vector<Page> pages(2);
  for (Page& page : pages) page.scan_map = ScanMap(2, 2);
  pages[0].scan_map.u(0, 0) = 12;
  pages[0].scan_map.v(0, 0) = 22;
  pages[1].scan_map.u(1, 1) = 30.4f;
  pages[1].scan_map.v(1, 1) = 1e6f;
  const Picture crop = crop_to_pages(scan, pages);
  EXPECT_EQ(crop.width(), 19);
  EXPECT_EQ(crop.height(), 18);
  EXPECT_EQ(std::get<0>(crop.samples)(0, 0), 99);
  EXPECT_EQ(crop_to_pages(scan, std::vector<Page>(1)).width(), 0);
}

TEST(DifferenceOf, IsPositiveTowardsTheReader) {
  PageSurface surface;
  surface.model = surface.measured = Image<Eigen::Vector3f>(5, 5);
  surface.status = Image<PixelStatus>(5, 5, PixelStatus::ok);
  for (int j = 0; j < 5; ++j)
    for (int i = 0; i < 5; ++i) {
      surface.model(i, j) = {2.f * static_cast<float>(i), -2.f * static_cast<float>(j), 7};
      surface.measured(i, j) = surface.model(i, j) + Eigen::Vector3f(0, 0, 0.5f);
    }
  surface.status(1, 1) = PixelStatus::hidden;
  const Image<float> difference = difference_of(surface);
  EXPECT_NEAR(difference(0, 0), 0.5, 1e-6);
  EXPECT_NEAR(difference(4, 3), 0.5, 1e-6);
  EXPECT_TRUE(std::isnan(difference(1, 1)));
}

}  // namespace
}  // namespace pagesweep
