// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/dewarping/resample.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "pagesweep/base/instruction_sets_testing.h"
#include "pagesweep/base/parallel.h"
#include "pagesweep/dewarping/printed_page_testing.h"

namespace pagesweep {
namespace {

/// u = u0 + a x + b y, v = v0 + c x + d y
ScanMap make_map(int width, int height, double u0, double v0, double a, double b, double c, double d) {
  ScanMap map(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      map.u(x, y) = static_cast<float>(u0 + a * x + b * y);
      map.v(x, y) = static_cast<float>(v0 + c * x + d * y);
    }
  return map;
}

ScanMap identity(int width, int height) { return make_map(width, height, 0, 0, 1, 0, 0, 1); }

Picture random_picture(int width, int height, int channels, int bit_depth) {
  Picture picture = make_picture(width, height, channels, bit_depth);
  std::mt19937 random(3);
  std::visit(
      [&]<class T>(Image<T>& samples) {
        for (T& sample : samples.pixels()) sample = static_cast<T>(random());
      },
      picture.samples);
  return picture;
}

bool same(const Picture& a, const Picture& b) {
  return std::visit(
      [&]<class T>(const Image<T>& samples) {
        const auto& others = std::get<Image<T>>(b.samples);
        return std::equal(samples.pixels().begin(), samples.pixels().end(), others.pixels().begin(),
                          others.pixels().end());
      },
      a.samples);
}

/// Largest difference of two pictures of the same kind, in gray values.
double largest_difference(const Picture& a, const Picture& b) {
  return std::visit(
      [&]<class T>(const Image<T>& samples) {
        double largest = 0;
        for (std::size_t i = 0; i < samples.size(); ++i)
          largest = std::max(largest,
                             std::abs(double(samples.pixels()[i]) - double(std::get<Image<T>>(b.samples).pixels()[i])));
        return largest;
      },
      a.samples);
}

TEST(Resample, IdentityMapReturnsThePictureExactly) {
  for (const int channels : {1, 3})
    for (const int bits : {8, 16})
      for (const auto kernel : {ResampleKernel::catmull_rom, ResampleKernel::lanczos3}) {
        const Picture scan = random_picture(37, 23, channels, bits);
        EXPECT_TRUE(same(resample(scan, identity(37, 23), 1, {.kernel = kernel}), scan)) << name_of(kernel);
      }
}

TEST(Resample, ConstantPictureStaysConstantExactly) {
  for (const int bits : {8, 16}) {
    Picture scan = make_picture(60, 50, 3, bits);
    for (int y = 0; y < 50; ++y)
      for (int x = 0; x < 60; ++x) set_pixel(scan, x, y, 0.7123);
    for (const double scale : {0.4, 1.0, 1.37, 2.5}) {
      const ScanMap map = make_map(20, 17, 0.3, 0.1, scale, 0.1, -0.07, scale);
      const Picture page = resample(scan, map, 1);
      for (int y = 0; y < 17; ++y)
        for (int x = 0; x < 20; ++x)
          if (map.v(x, y) >= 0) {
            ASSERT_EQ(pixel_at(page, x, y), pixel_at(scan, 0, 0));
          }
    }
  }
}

TEST(Resample, AgreesWithThePlainLoop) {
  // Phases in steps of 1/512 px and widths in steps of 1/32 are what the tables lose: on noise, the hardest picture,
  // half a phase step moves a sample by up to 255 / 1024 times the kernel's steepest slope, about 1; a width step by
  // about 1/64 of the 255. Measured: 4 at most.
  for (const int channels : {1, 3})
    for (const auto kernel : {ResampleKernel::catmull_rom, ResampleKernel::mitchell, ResampleKernel::lanczos3})
      for (const double scale : {0.5, 1.0, 1.2, 1.6, 3.1}) {
        const Picture scan = random_picture(150, 140, channels, 8);
        const ScanMap map = make_map(40, 39, -0.4, 1.3, scale, 0.05, -0.02, 0.9 * scale);
        EXPECT_LE(largest_difference(resample(scan, map, 1, {.kernel = kernel}),
                                     resample_plainly(scan, map, 1, {.kernel = kernel})),
                  5)
            << name_of(kernel) << " " << scale;
      }
}

TEST(Resample, EveryInstructionSetAgreesWithThePlainLoop) {
  // Odd sizes, odd strides, tiles that end anywhere, and positions beyond all four borders.
  const ScanMap map = make_map(151, 19, -1.2, -0.9, 0.93, 0.03, -0.02, 0.97);
  on_every_instruction_set([&] {
    for (const int channels : {1, 3})
      for (const int bits : {8, 16}) {
        const Picture scan = random_picture(137, 17, channels, bits);
        const Picture plain = resample_plainly(scan, map, 1);
        // Positions in steps of 1/512 px: half a step times the kernel's steepest slopes, about 1 a pixel along either
        // axis, of noise. 16 bit resolves 256 times more.
        EXPECT_LE(largest_difference(resample(scan, map, 1), plain), bits == 8 ? 2 : 2 * 256)
            << channels << " " << bits;
      }
  });
}

TEST(Resample, EightBitResultsAreTheSameOnAllProcessors) {
  const Picture scan = random_picture(137, 61, 3, 8);
  const ScanMap map = make_map(97, 53, 3.2, 2.9, 1.03, 0.03, -0.02, 1.01);
  const Picture best = resample(scan, map, 1);
  on_every_instruction_set([&] { EXPECT_TRUE(same(resample(scan, map, 1), best)); });
}

TEST(Resample, EightAndSixteenBitGrayAndColourAgreeWithinRounding) {
  const StrokePattern strokes(80, 0.6);
  const ScanMap map = make_map(60, 60, 5.2, 4.9, 1.03, 0.02, -0.02, 0.97);
  const Picture gray8 = resample(strokes.render(80, 80, 1, 8), map, 1);
  const Picture rgb8 = resample(strokes.render(80, 80, 3, 8), map, 1);
  const Picture gray16 = resample(strokes.render(80, 80, 1, 16), map, 1);
  const Picture rgb16 = resample(strokes.render(80, 80, 3, 16), map, 1);
  for (int y = 0; y < 60; ++y)
    for (int x = 0; x < 60; ++x) {
      ASSERT_EQ(pixel_at(gray8, x, y), pixel_at(rgb8, x, y));
      ASSERT_EQ(pixel_at(gray16, x, y), pixel_at(rgb16, x, y));
      // Half a gray value in the result and, through the kernel's absolute weights (sum below 1.7), in the input.
      ASSERT_NEAR(pixel_at(gray8, x, y), pixel_at(gray16, x, y), (0.5 + 1.7 * 0.5) / 255);
    }
}

TEST(Resample, GrayIsColourOnEveryInstructionSet) {
  on_every_instruction_set([] {
    for (const int bits : {8, 16})
      for (const auto kernel : {ResampleKernel::catmull_rom, ResampleKernel::lanczos3})
        for (const double scale : {0.97, 1.3, 2.9}) {
          const Picture gray = random_picture(137, 61, 1, bits);
          Picture colour = make_picture(137, 61, 3, bits);
          for (int y = 0; y < 61; ++y)
            for (int x = 0; x < 137; ++x) set_pixel(colour, x, y, pixel_at(gray, x, y));
          const ScanMap map = make_map(43, 19, 0.2, -0.1, scale, 0.03, -0.02, scale);
          const Picture from_gray = resample(gray, map, 1, {.kernel = kernel});
          const Picture from_colour = resample(colour, map, 1, {.kernel = kernel});
          for (int y = 0; y < 19; ++y)
            for (int x = 0; x < 43; ++x)
              ASSERT_EQ(pixel_at(from_gray, x, y), pixel_at(from_colour, x, y)) << bits << " " << scale;
        }
  });
}

TEST(Resample, HiddenPixelsAreFilledAndOvershootIsClipped) {
  Picture scan = make_picture(40, 40, 1, 8);
  for (int y = 0; y < 40; ++y)
    for (int x = 0; x < 40; ++x) set_pixel(scan, x, y, x < 20 ? 0 : 1);
  ScanMap map = make_map(70, 40, 0, 0, 0.5, 0, 0, 1);
  map.u(3, 5) = not_a_number;
  map.u(60, 7) = 1e30f;
  map.v(61, 7) = -std::numeric_limits<float>::infinity();
  const Picture white = resample(scan, map, 1);
  EXPECT_EQ(pixel_at(white, 3, 5), 1);
  EXPECT_EQ(pixel_at(white, 60, 7), 1);
  EXPECT_EQ(pixel_at(resample(scan, map, 1, {.fill = 0}), 61, 7), 0);
  for (int x = 0; x < 70; ++x) {  // rings on both sides of the step must not wrap round
    if (x != 39) {
      EXPECT_NEAR(pixel_at(white, x, 20), x < 39 ? 0 : 1, 0.2) << x;
    }
  }
}

TEST(Resample, FineGratingMinifiedTwiceIsFlatGray) {
  // 0.4 cycles a scan pixel is 0.8 a page pixel: without widening it would come out as a grating of 0.2.
  Picture scan = make_picture(300, 300, 1, 16);
  for (int y = 0; y < 300; ++y)
    for (int x = 0; x < 300; ++x) set_pixel(scan, x, y, 0.5 + 0.4 * std::cos(2 * std::numbers::pi * 0.4 * x));
  for (const auto& [kernel, bound] : {std::pair{ResampleKernel::lanczos3, 0.02},
                                      {ResampleKernel::catmull_rom, 0.04},
                                      {ResampleKernel::mitchell, 0.03}}) {
    const Picture page = resample(scan, make_map(120, 120, 10, 10, 2, 0, 0, 2), 1, {.kernel = kernel});
    const Picture turned = resample(scan, make_map(120, 120, 10, 10, 0, 2, 2, 0), 1, {.kernel = kernel});
    for (int y = 0; y < 120; ++y)
      for (int x = 0; x < 120; ++x) {
        ASSERT_NEAR(pixel_at(page, x, y), 0.5, bound) << name_of(kernel);
        ASSERT_NEAR(pixel_at(turned, x, y), 0.5, bound) << name_of(kernel);
      }
  }
}

TEST(Resample, AHiddenStripDoesNotBlurItsNeighbours) {
  const StrokePattern strokes(200, 0.6);
  const Picture scan = strokes.render(200, 200, 1, 8);
  ScanMap map = make_map(100, 100, 20.3, 20.2, 1, 0, 0, 1);
  for (int y = 0; y < 100; ++y)
    for (int x = 50; x < 100; ++x) map.u(x, y) += 40;
  EXPECT_GT(psnr_db(resample(scan, map, 1), map, [&](double u, double v) { return strokes.at(u, v); }), 40);
}

TEST(Resample, KernelsReachTheirPsnrOnStrokes) {
  // Strokes of 1.5 to 3.5 px under a point spread function of 0.6 px, turned, scaled by 0.97 to 1.01. The default is
  // the kernel with the highest figure (docs/derivations/dewarping.md).
  const StrokePattern strokes(360, 0.6);
  const Picture scan = strokes.render(360, 360, 1, 8);
  const ScanMap map = make_map(340, 340, 9.3, 9.7, 0.99, -0.01, 0.01, 0.98);
  const auto psnr = [&](ResampleKernel kernel) {
    return psnr_db(resample(scan, map, 1, {.kernel = kernel}), map,
                   [&](double u, double v) { return strokes.at(u, v); });
  };
  RecordProperty("catmull_rom_db", std::to_string(psnr(ResampleKernel::catmull_rom)));
  RecordProperty("lanczos3_db", std::to_string(psnr(ResampleKernel::lanczos3)));
  EXPECT_GT(psnr(ResampleKernel::mitchell), 30);
  EXPECT_GT(psnr(ResampleKernel::catmull_rom), 40);
  EXPECT_GT(psnr(ResampleKernel::lanczos3), 43);
  EXPECT_GT(psnr(ResampleOptions().kernel), psnr(ResampleKernel::catmull_rom));
}

TEST(Resample, CarriesTheFileDataOver) {
  Picture scan = random_picture(20, 20, 3, 8);
  scan.icc_profile = {std::byte{1}, std::byte{2}};
  scan.metadata["exif"] = {std::byte{3}};
  const Picture page = resample(scan, identity(5, 5), 11.8);
  EXPECT_EQ(page.pixels_per_mm, 11.8);
  EXPECT_EQ(page.icc_profile, scan.icc_profile);
  EXPECT_EQ(page.metadata, scan.metadata);
}

TEST(Resample, DoesNotDependOnTheNumberOfThreads) {
  const Picture scan = random_picture(150, 140, 3, 8);
  const ScanMap map = make_map(90, 77, 3.4, 1.3, 1.3, 0.05, -0.02, 1.1);
  const Picture many = resample(scan, map, 1);
  const ThreadLimit one(1);
  EXPECT_TRUE(same(many, resample(scan, map, 1)));
}

TEST(Resample, SmallScansAgreeWithThePlainLoop) {
  // Vectors are longer than these rows, and kernels larger than some of the pictures.
  for (int width = 1; width < 12; ++width)
    for (const int height : {1, 5, 8})
      for (const int channels : {1, 3}) {
        const Picture scan = random_picture(width, height, channels, 8);
        const ScanMap map = make_map(width + 2, height + 2, -0.7, -0.6, 0.9, 0, 0, 0.9);
        EXPECT_LE(largest_difference(resample(scan, map, 1), resample_plainly(scan, map, 1)), 2)
            << width << " x " << height;
      }
}

TEST(Resample, RefusesAnEmptyScan) { EXPECT_THROW(resample(Picture{}, identity(3, 3), 1), std::invalid_argument); }

}  // namespace
}  // namespace pagesweep
