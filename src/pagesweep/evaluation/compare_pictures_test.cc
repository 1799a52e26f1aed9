// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/evaluation/compare_pictures.h"

#include <gtest/gtest.h>

#include <cmath>

namespace pagesweep {
namespace {

/// Printed pattern at a place of the page [mm]: soft-edged dots, gray values 40 to 220.
double pattern(double x_mm, double y_mm) {
  return 130 + 90 * std::tanh(2 * std::sin(3 * x_mm + 0.3 * y_mm) * std::sin(2.2 * y_mm));
}

struct View {
  int width = 420, height = 360;
  double pixels_per_mm = 10;
  double turned_rad = 0;                ///< clockwise
  Eigen::Vector2d shifted_mm = {0, 0};  ///< on the true page, of the result's corner
  double gain = 1, offset = 0;
  double bend_mm = 0;
};

Picture show(const View& view) {
  Picture picture = make_picture(view.width, view.height, 1, 8);
  picture.pixels_per_mm = view.pixels_per_mm;
  auto& samples = std::get<0>(picture.samples);
  const double c = std::cos(view.turned_rad), s = std::sin(view.turned_rad);
  for (int y = 0; y < view.height; ++y)
    for (int x = 0; x < view.width; ++x) {
      const double a = (x + 0.5) / view.pixels_per_mm, b = (y + 0.5) / view.pixels_per_mm;
      const double u = c * a + s * b + view.shifted_mm.x(), v = c * b - s * a + view.shifted_mm.y();
      const double light = pattern(u + view.bend_mm * std::sin(0.1 * v), v);
      samples(x, y) = static_cast<std::uint8_t>(std::lround(view.gain * light + view.offset));
    }
  return picture;
}

/// What compare_pages() would say of such a view.
PageErrors alignment_of(const View& view) {
  PageErrors alignment;
  alignment.rotation_rad = view.turned_rad;
  alignment.shift_mm = view.shifted_mm;
  return alignment;
}

PictureErrors compare(const View& view) { return compare_pictures(show(view), show({}), alignment_of(view)); }

TEST(ComparePictures, TurnShiftAndResolutionCostNothing) {
  EXPECT_GT(compare({}).ms_ssim, 0.9999);
  EXPECT_GT(compare({.turned_rad = 0.02, .shifted_mm = {1.23, 2.31}}).ms_ssim, 0.999);
  EXPECT_GT(compare({.width = 540, .height = 500, .pixels_per_mm = 14.3, .shifted_mm = {-0.7, 0.4}}).ms_ssim, 0.999);
}

TEST(ComparePictures, ExposureCostsOnlyUntilItIsMadeTheSame) {
  const PictureErrors darker = compare({.gain = 0.6, .offset = 5});
  EXPECT_GT(darker.ms_ssim_same_exposure, 0.999);
  EXPECT_LT(darker.ms_ssim, 0.98);
}

TEST(ComparePictures, BentLinesCost) {
  const double slightly = compare({.bend_mm = 0.02}).ms_ssim, strongly = compare({.bend_mm = 0.2}).ms_ssim;
  EXPECT_GT(slightly, 0.98);
  EXPECT_LT(strongly, slightly - 0.05);
}

TEST(ComparePictures, PagesThatHardlyOverlapHaveNoValue) {
  EXPECT_TRUE(std::isnan(compare({.shifted_mm = {40, 0}}).ms_ssim));
}

}  // namespace
}  // namespace pagesweep
