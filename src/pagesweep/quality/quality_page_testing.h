// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <random>

#include "pagesweep/data/page.h"
#include "pagesweep/data/transfer_curve.h"

/// Flat pages whose quality is known, for the tests of this directory.
namespace pagesweep {

/// A page of light given at every place [px], noise in the samples' own unit, seen in a scan of `scale` pixels a page
/// pixel.
inline Page make_test_page(int width, int height, const std::function<double(double x, double y)>& light,
                           double noise = 0, double scale = 1) {
  Page page;
  page.picture = make_picture(width, height, 1, 8);
  page.picture.pixels_per_mm = 300 / 25.4;
  page.scan_map = ScanMap(width, height);
  auto& samples = std::get<Image<std::uint8_t>>(page.picture.samples);
  const TransferCurve srgb;
  std::mt19937 random(3);
  std::normal_distribution<double> normal(0, 1);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const double value = 255 * srgb.sample(light(x, y)) + noise * normal(random);
      samples(x, y) = static_cast<std::uint8_t>(std::clamp(value + 0.5, 0.0, 255.0));
      page.scan_map.u(x, y) = static_cast<float>(scale * x + 10);
      page.scan_map.v(x, y) = static_cast<float>(y + 10);
    }
  return page;
}

/// Light of a dark bar from x0 to x1 under a Gaussian point spread.
inline double blurred_bar(double x, double x0, double x1, double sigma_px) {
  const auto step = [&](double at) { return 0.5 * (1 + std::erf((x - at) / (sigma_px * std::sqrt(2.0)))); };
  return 0.8 - 0.75 * (step(x0) - step(x1));
}

}  // namespace pagesweep
