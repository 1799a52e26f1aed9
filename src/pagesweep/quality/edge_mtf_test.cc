// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/quality/edge_mtf.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "pagesweep/data/transfer_curve.h"
#include "pagesweep/quality/paper_look.h"
#include "pagesweep/quality/quality_page_testing.h"

namespace pagesweep {
namespace {

/// Upright bars 9 px wide at all phases of the pixel grid.
double bars(double x, double y, double sigma) {
  const double pitch = 30.37;
  const double row = std::floor(y / 40);
  const double offset = pitch * std::floor(x / pitch) + 8 + std::fmod(7.31 * row, 5.0);
  return blurred_bar(x, offset, offset + 9.2, sigma);
}

double gaussian_mtf(double sigma, double frequency) {
  return std::exp(-2 * std::pow(std::numbers::pi * sigma * frequency, 2));
}

TEST(EdgeMtf, IsThatOfTheLens) {
  for (const double sigma : {0.55, 0.7, 0.9}) {
    const Page page = make_test_page(700, 600, [&](double x, double y) { return bars(x, y, sigma); }, 0.8);
    const Image<float> light = light_of_page(page);
    const auto [across, down] = measure_sharpness(page, light, PictureLight(page.picture));
    ASSERT_GT(across.edges, 200);
    EXPECT_EQ(down.edges, 0);  // the bars' ends are at the page's own
    for (const double frequency : {0.1, 0.2, 0.3})
      EXPECT_NEAR(across.page.at(frequency), gaussian_mtf(sigma, frequency), 0.04) << sigma << " " << frequency;
    const double mtf50 = std::sqrt(std::log(2.0) / 2) / (std::numbers::pi * sigma);
    EXPECT_NEAR(across.page.frequency_at(0.5), mtf50, 0.04 * mtf50 + 0.005) << sigma;
  }
}

TEST(EdgeMtf, TheScansOwnIsMeasuredAtTheSameEdges) {
  // The scan is sharper than the page: sigma 0.5 of its pixels, of which 1.25 are one of the page's.
  const double scale = 1.25, sigma_page = 0.9, sigma_scan_px = 0.6;
  const Page page = make_test_page(700, 600, [&](double x, double y) { return bars(x, y, sigma_page); }, 0, scale);
  Picture scan = make_picture(static_cast<int>(700 * scale) + 20, 620, 1, 16);
  const TransferCurve curve;
  for (int v = 0; v < scan.height(); ++v)
    for (int u = 0; u < scan.width(); ++u)
      std::get<Image<std::uint16_t>>(scan.samples)(u, v) =
          static_cast<std::uint16_t>(65535 * curve.sample(bars((u - 10) / scale, v - 10, sigma_scan_px / scale)) + 0.5);
  const auto across = measure_sharpness(page, light_of_page(page), PictureLight(scan))[0];
  ASSERT_FALSE(across.scan.values.empty());
  for (const double frequency : {0.1, 0.25})
    EXPECT_NEAR(across.scan.at(frequency), gaussian_mtf(sigma_scan_px / scale, frequency), 0.05) << frequency;
}

TEST(EdgeMtf, HasNothingToSayAboutBlankPaper) {
  const Page page = make_test_page(300, 300, [](double, double) { return 0.8; }, 2);
  const Image<float> light = light_of_page(page);
  for (const EdgeSharpness& sharpness : measure_sharpness(page, light, PictureLight(page.picture))) {
    EXPECT_EQ(sharpness.edges, 0);
    EXPECT_TRUE(sharpness.page.values.empty());
  }
}

}  // namespace
}  // namespace pagesweep
