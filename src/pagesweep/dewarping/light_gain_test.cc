// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/dewarping/light_gain.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "pagesweep/data/transfer_curve.h"

namespace pagesweep {
namespace {

struct Form {
  int channels, bit_depth;
};

class LightGains : public testing::TestWithParam<Form> {
 protected:
  static constexpr int width = 45, height = 37;  // no whole number of vectors or of a thread's rows

  /// A page of all kinds of samples, every seventh pixel of which the scan does not show.
  static Page page() {
    Page page;
    page.picture = make_picture(width, height, GetParam().channels, GetParam().bit_depth);
    page.picture.pixels_per_mm = 4;
    page.scan_map = ScanMap(width, height);
    const int white = (1 << GetParam().bit_depth) - 1;
    std::visit(
        [&](auto& samples) {
          for (int y = 0; y < height; ++y)
            for (int x = 0; x < samples.width(); ++x) samples(x, y) = sample_at(x, y) * white / 100;
        },
        page.picture.samples);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x)
        if (!is_hidden(x, y)) page.scan_map.u(x, y) = page.scan_map.v(x, y) = 1;
    return page;
  }
  static int sample_at(int x, int y) { return (7 * x + 13 * y) % 101; }
  static bool is_hidden(int x, int y) { return (x + y) % 7 == 3; }

  /// Planes of gains, which bilinear interpolation leaves as they are.
  static LightGain gain() {
    LightGain gain;
    for (std::size_t c = 0; c < 3; ++c) {
      gain.values[c] = Image<float>(14, 12, 0.0f);
      for (int j = 0; j < 12; ++j)
        for (int i = 0; i < 14; ++i) gain.values[c](i, j) = static_cast<float>(gain_at(c, i, j));
    }
    return gain;
  }
  static double gain_at(std::size_t c, double x_mm, double y_mm) {
    return 0.8 + 0.1 * double(c) + 0.02 * x_mm + 0.01 * y_mm;
  }
};

TEST_P(LightGains, MultiplyTheLightOfEverySample) {
  Page page = LightGains::page();
  const Picture before = page.picture;
  apply_gain(gain(), page);
  const TransferCurve curve = TransferCurve::of(before);
  const int white = (1 << GetParam().bit_depth) - 1, channels = GetParam().channels;
  std::visit(
      [&]<class T>(const Image<T>& samples) {
        const auto& old = std::get<Image<T>>(before.samples);
        for (int y = 0; y < height; ++y)
          for (int k = 0; k < samples.width(); ++k) {
            const int x = k / channels;
            if (is_hidden(x, y)) {
              EXPECT_EQ(samples(k, y), old(k, y)) << k << " " << y;
              continue;
            }
            const double factor = gain_at(static_cast<std::size_t>(k % channels), (x + 0.5) / 4, (y + 0.5) / 4);
            const double light = std::min(1.0, factor * curve.light(double(old(k, y)) / white));
            // Half a step of rounding, and what the tables err by: those of 8 bit in steps of the gain and of the
            // light.
            const double table_error = GetParam().bit_depth == 8 ? 0.03 : 2e-5 * white;
            EXPECT_NEAR(samples(k, y), curve.sample(light) * white, 0.5 + table_error) << k << " " << y;
          }
      },
      page.picture.samples);
}

INSTANTIATE_TEST_SUITE_P(, LightGains, testing::Values(Form{1, 8}, Form{3, 8}, Form{1, 16}, Form{3, 16}),
                         [](const auto& form) {
                           return (form.param.channels == 1 ? "gray" : "rgb") + std::to_string(form.param.bit_depth);
                         });

}  // namespace
}  // namespace pagesweep
