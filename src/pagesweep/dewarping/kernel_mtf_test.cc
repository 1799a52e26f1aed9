// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/dewarping/kernel_mtf.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "pagesweep/dewarping/printed_page_testing.h"

namespace pagesweep {
namespace {

/// Amplitude of a wave along x after resampling, over its amplitude before.
double measured_share(ResampleKernel kernel, double scan_px_per_page_px, double frequency) {
  constexpr int width = 600;
  Picture scan = make_picture(width, 32, 1, 16);
  for (int y = 0; y < 32; ++y)
    for (int x = 0; x < width; ++x) set_pixel(scan, x, y, 0.5 + 0.3 * std::cos(2 * std::numbers::pi * frequency * x));
  const int pixels = static_cast<int>((width - 40) / scan_px_per_page_px);
  ScanMap map(pixels, 8);
  for (int y = 0; y < 8; ++y)
    for (int x = 0; x < pixels; ++x) {
      map.u(x, y) = static_cast<float>(20 + x * scan_px_per_page_px);
      map.v(x, y) = 10.0f + static_cast<float>(y);
    }
  const Picture page = resample(scan, map, 1, {.kernel = kernel});
  double real = 0, imaginary = 0, all = 0;
  for (int x = 4; x < pixels - 4; ++x) {
    const double angle = 2 * std::numbers::pi * frequency * double(map.u(x, 4));
    const double window = std::pow(std::sin(std::numbers::pi * (x - 3.5) / (pixels - 8)), 2);
    real += window * (pixel_at(page, x, 4) - 0.5) * std::cos(angle);
    imaginary += window * (pixel_at(page, x, 4) - 0.5) * std::sin(angle);
    all += window;
  }
  return 2 * std::hypot(real, imaginary) / all / 0.3;
}

TEST(KernelMtf, IsWhatResamplingDoesToAWave) {
  for (const ResampleKernel kernel : {ResampleKernel::catmull_rom, ResampleKernel::mitchell, ResampleKernel::lanczos3})
    for (const double scale : {0.613, 1.0713, 1.731})
      for (const double frequency : {0.05, 0.13, 0.24}) {
        const double width = std::max(1.0, scale);
        EXPECT_NEAR(measured_share(kernel, scale, frequency), kernel_mtf(kernel, width, frequency), 0.02)
            << name_of(kernel) << " " << scale << " " << frequency;
      }
}

TEST(KernelMtf, KeepsWhatIsEven) {
  EXPECT_NEAR(kernel_mtf(ResampleKernel::lanczos3, 1, 0), 1, 1e-6);
  EXPECT_GT(kernel_mtf(ResampleKernel::lanczos3, 1, 0.25), 0.97);
  EXPECT_LT(kernel_mtf(ResampleKernel::lanczos3, 2, 0.45), 0.05);
}

}  // namespace
}  // namespace pagesweep
