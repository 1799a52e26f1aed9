// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/surfacing/smooth_points.h"

#include <gtest/gtest.h>

#include "pagesweep/surfacing/find_gutter.h"
#include "pagesweep/surfacing/find_paper.h"
#include "pagesweep/surfacing/scenes_for_tests.h"

namespace pagesweep {
namespace {

const double nan = std::numeric_limits<double>::quiet_NaN();

/// Points as two cameras of full size deliver them: a map whose pixels lie 0.3 mm apart on a surface.
PointMap dense_points(const std::function<double(double x, double y)>& height, double noise_mm, double outliers = 0) {
  PointMap map(256, 256);
  const scenes::Noise noise(7);
  for (int y = 0; y < 256; ++y)
    for (int x = 0; x < 256; ++x) {
      const auto pixel = static_cast<std::uint64_t>(y * 256 + x);
      const double px = 0.3 * (x - 128) + 0.2 * noise.uniform(16 * pixel + 9), py = -0.3 * (y - 128);
      map.x(x, y) = static_cast<float>(px);
      map.y(x, y) = static_cast<float>(py);
      double error = noise_mm * noise.gauss(8 * pixel);
      if (noise.uniform(16 * pixel + 10) < outliers) error = 1 + 20 * noise.uniform(16 * pixel + 11);
      map.z(x, y) = static_cast<float>(height(px, py) + error);
      map.sigma(x, y) = static_cast<float>(noise_mm);
      map.intensity(x, y) = 100;
      map.status(x, y) = PixelStatus::ok;
    }
  return map;
}

double rms_error(const HeightField& field, const std::function<double(double p, double q)>& height, double inside_mm) {
  double squares = 0;
  int cells = 0;
  for (int j = 0; j < field.rows(); ++j)
    for (int i = 0; i < field.columns(); ++i) {
      const double p = field.p_of(i), q = field.q_of(j);
      if (std::max(std::abs(p), std::abs(q)) > inside_mm) continue;
      if (field.status(i, j) != PixelStatus::ok) continue;
      squares += std::pow(field.z(i, j) - height(p, q), 2);
      ++cells;
    }
  return cells > 0 ? std::sqrt(squares / cells) : nan;
}

TEST(SmoothPoints, FitsAFlatSheetToAFiftiethOfAMillimetre) {
  const auto sheet = [](double x, double y) { return 3 + 0.1 * x - 0.2 * y; };
  const std::vector<PointMap> maps{dense_points(sheet, 0.1)};
  const HeightField field = smooth_points(maps);
  // A biweight paraboloid's variance is 9 / 4 of that of ... 1250 points within 6 mm: 0.1 sqrt(5 / 1250) = 0.006
  EXPECT_LT(rms_error(field, sheet, 36), 0.01);
  EXPECT_LT(field.outliers, field.points / 1000);
  EXPECT_NEAR(field.cell_mm, 1, 1e-6);
}

TEST(SmoothPoints, SigmaTellsTheError) {
  const auto sheet = [](double x, double) { return 3 + 0.002 * x * x; };
  const std::vector<PointMap> maps{dense_points(sheet, 0.1)};
  const HeightField field = smooth_points(maps);
  double normalised = 0;
  int cells = 0;
  for (int j = 8; j < field.rows() - 8; ++j)
    for (int i = 8; i < field.columns() - 8; ++i) {
      normalised += std::pow((field.z(i, j) - sheet(field.p_of(i), 0)) / field.sigma(i, j), 2);
      ++cells;
    }
  // Neighbouring cells share points: about 60 independent values.
  EXPECT_NEAR(std::sqrt(normalised / cells), 1, 0.35);
}

TEST(SmoothPoints, SetsOutliersAsideAndCountsThem) {
  const auto sheet = [](double x, double y) { return 0.1 * x - 0.2 * y; };
  const std::vector<PointMap> maps{dense_points(sheet, 0.08, 0.1)};
  const HeightField field = smooth_points(maps);
  EXPECT_NEAR(static_cast<double>(field.outliers), 0.1 * 65536, 0.005 * 65536);
  EXPECT_LT(rms_error(field, sheet, 36), 0.01);
}

TEST(SmoothPoints, KeepsTheCreaseOfAGutterSharp) {
  const auto book = [](double x, double) { return 1.2 * std::abs(x - 0.3); };
  const std::vector<PointMap> maps{dense_points(book, 0.08)};
  const HeightField field = smooth_points(maps);
  // A symmetric window of 6 mm would lift the crease by about a millimetre.
  for (int j = 10; j < field.rows() - 10; ++j)
    for (int i = 10; i < field.columns() - 10; ++i)
      if (std::abs(field.p_of(i) - 0.3) > 1) {
        EXPECT_NEAR(field.z(i, j), book(field.p_of(i), 0), 0.15);
      }
  EXPECT_LT(rms_error(field, book, 30), 0.06);
}

TEST(SmoothPoints, LeavesHolesOpenAndSaysWhy) {
  std::vector<PointMap> maps{dense_points([](double, double) { return 5.0; }, 0.08)};
  for (int y = 100; y < 150; ++y)
    for (int x = 100; x < 150; ++x) {
      maps[0].status(x, y) = PixelStatus::bad_fit;
      maps[0].x(x, y) = maps[0].y(x, y) = maps[0].z(x, y) = maps[0].sigma(x, y) = not_a_number;
    }
  const HeightField field = smooth_points(maps);
  const int i = static_cast<int>(std::lround(field.i_of(-0.9))), j = static_cast<int>(std::lround(field.j_of(0.9)));
  EXPECT_TRUE(std::isnan(field.z(i, j)));
  EXPECT_EQ(field.status(i, j), PixelStatus::bad_fit);
}

TEST(FindGutter, TellsABookFromACreasedSheet) {
  const auto gutter_of = [](double slope_left, double slope_right, double where) {
    const std::vector<PointMap> maps{dense_points(
        [=](double x, double y) {
          const double a = x - where - 0.05 * y;
          return a < 0 ? -slope_left * a : slope_right * a;
        },
        0.08)};
    const HeightField field = smooth_points(maps);
    return find_gutter(field, find_paper(field));
  };
  const auto gutter = gutter_of(0.8, 0.6, 5);
  ASSERT_TRUE(gutter);
  EXPECT_NEAR(gutter->p_mm - 0.05 * gutter->q_mm, 5, 0.5);
  EXPECT_NEAR(gutter->slope, 0.05, 0.01);
  EXPECT_NEAR(gutter->kink_rad, std::atan(0.8) + std::atan(0.6), 0.05);
  EXPECT_FALSE(gutter_of(0, 0, 0)) << "flat";
  EXPECT_FALSE(gutter_of(0.1, 0.1, 0)) << "a shallow fold";
  EXPECT_FALSE(gutter_of(-0.6, -0.6, 0)) << "a ridge";
  EXPECT_FALSE(gutter_of(0.8, 0.8, 32)) << "far from the middle";
}

TEST(FindPaper, KeepsPhotosAndLeavesTheTable) {
  // Paper of 50 x 60 mm, 4 mm above a table of a fifth of its brightness; a dark photo within, another at its edge.
  const auto is_paper = [](double x, double y) { return std::abs(x) < 25 && std::abs(y) < 30; };
  std::vector<PointMap> maps{dense_points([&](double x, double y) { return is_paper(x, y) ? 4.0 : 0.0; }, 0.05)};
  for (int y = 0; y < 256; ++y)
    for (int x = 0; x < 256; ++x) {
      const double px = maps[0].x(x, y), py = maps[0].y(x, y);
      const bool photo = (std::abs(px) < 12 && std::abs(py) < 12) || (px > 5 && py > 15);
      maps[0].intensity(x, y) = !is_paper(px, py) ? 20.0f : photo ? 15.0f : 100.0f;
    }
  const HeightField field = smooth_points(maps);
  const auto paper = find_paper(field);
  for (int j = 0; j < field.rows(); ++j)
    for (int i = 0; i < field.columns(); ++i) {
      const double p = std::abs(field.p_of(i)), q = std::abs(field.q_of(j));
      if (p < 22 && q < 27) {
        EXPECT_TRUE(paper(i, j)) << field.p_of(i) << ", " << field.q_of(j);
      }
      if (p > 27 || q > 32) {
        EXPECT_FALSE(paper(i, j)) << field.p_of(i) << ", " << field.q_of(j);
      }
    }
}

TEST(FindPaper, TakesEverythingWhereThereIsNoTable) {
  std::vector<PointMap> maps{dense_points([](double x, double) { return 0.01 * x * x; }, 0.05)};
  for (float& intensity : maps[0].intensity.pixels()) intensity = 80;
  const HeightField field = smooth_points(maps);
  const auto paper = find_paper(field);
  for (std::size_t k = 0; k < paper.size(); ++k) EXPECT_EQ(paper.data()[k] != 0, std::isfinite(field.z.data()[k]));
}

}  // namespace
}  // namespace pagesweep
