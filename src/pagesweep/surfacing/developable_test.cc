// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "pagesweep/surfacing/creased_sheet.h"
#include "pagesweep/surfacing/fit_surface.h"
#include "pagesweep/surfacing/scenes_for_tests.h"

namespace pagesweep {
namespace {

using scenes::flattening_error;
using scenes::measure;

const double nan = std::numeric_limits<double>::quiet_NaN();
const Eigen::Vector2d no_paper(nan, nan);

/// Cells of 1 mm with one reading each, off their middles, of a height.
Image<CellMean> readings_of(const std::function<double(double p, double q)>& height, int size, double noise_mm) {
  const scenes::Noise noise(7);
  Image<CellMean> cells(size, size);
  for (int j = 0; j < size; ++j)
    for (int i = 0; i < size; ++i) {
      const auto k = static_cast<std::uint64_t>(j * size + i);
      CellMean& cell = cells(i, j);
      cell.p = static_cast<float>(noise.uniform(10 * k) - 0.5);
      cell.q = static_cast<float>(noise.uniform(10 * k + 1) - 0.5);
      cell.z = static_cast<float>(height(i + double(cell.p), j + double(cell.q)) + noise_mm * noise.gauss(10 * k + 2));
      cell.weight = static_cast<float>(1 / (noise_mm * noise_mm));
      cell.count = 1;
    }
  return cells;
}

struct HeightErrors {
  double rms = 0, largest = 0;
};

HeightErrors fit_errors(const std::function<double(double p, double q)>& height, double noise_mm) {
  const int size = 60;
  const Image<double> nothing(size, size, 0);
  const Image<std::uint8_t> all(size, size, 1);
  const Image<double> z = fit_creased_sheet(readings_of(height, size, noise_mm), nothing, 1, 1, all, nothing);
  HeightErrors errors;
  for (int j = 3; j + 3 < size; ++j)
    for (int i = 3; i + 3 < size; ++i) {
      const double error = z(i, j) - height(i, j);
      errors.rms += error * error / ((size - 6.0) * (size - 6.0));
      errors.largest = std::max(errors.largest, std::abs(error));
    }
  errors.rms = std::sqrt(errors.rms);
  return errors;
}

TEST(CreasedSheet, AveragesNoiseWhereTheSheetIsPlane) {
  // Over a disc of 2 mm radius there are some twelve readings.
  EXPECT_LT(fit_errors([](double p, double q) { return 3 + 0.2 * p - 0.1 * q; }, 0.05).rms, 0.05 / std::sqrt(8));
}

TEST(CreasedSheet, KeepsCreasesSharpWhateverTheirDirection) {
  for (const double angle : {0.0, 0.4, 0.785}) {
    const auto fold = [&](double p, double q) {
      return 0.35 * std::abs((p - 30.3) * std::cos(angle) + (q - 29.6) * std::sin(angle));
    };
    const HeightErrors errors = fit_errors(fold, 0.04);
    EXPECT_LT(errors.rms, 0.025) << angle;
    // A window of 4 mm would cut off 0.35 * 2 / 2 mm.
    EXPECT_LT(errors.largest, 0.15) << angle;
  }
}

TEST(CreasedSheet, FollowsWhereCreasesMeet) {
  const auto roof = [](double p, double q) { return 9 - 0.3 * std::max(std::abs(p - 30), std::abs(q - 30)); };
  EXPECT_LT(fit_errors(roof, 0.04).rms, 0.03);
}

/// A leaf with an ear: beyond a diagonal line a corner bends up by 20 degrees, and the opposite one down.
struct DogEars {
  static constexpr double begin = 80;
  static constexpr double rise = 0.36397;  // tan 20 degrees
  static double beyond(double x, double y) { return (x + y) / std::numbers::sqrt2 - begin; }
  static double height(double x, double y) {
    if (!(std::abs(x) < 85 && std::abs(y) < 110)) return nan;
    return 14 + rise * std::max(0.0, beyond(x, y)) - rise * std::max(0.0, beyond(-x, y));
  }
  static Eigen::Vector2d paper(double x, double y) {
    if (std::isnan(height(x, y))) return no_paper;
    const double longer = (std::hypot(1, rise) - 1) / std::numbers::sqrt2;
    const double right = longer * std::max(0.0, beyond(x, y)), left = longer * std::max(0.0, beyond(-x, y));
    return {x + right - left, -(y + right + left)};
  }
};

TEST(Developable, LaysFoldedCornersFlat) {
  // Where both folds would meet there is no paper.
  static_assert(DogEars::begin * std::numbers::sqrt2 > 110);
  const auto points = measure({DogEars::height, 40, 0}, {.width_px = 224});
  const auto pages = fit_surface(points, {.layout = Layout::single});
  ASSERT_EQ(pages.size(), 1u);
  EXPECT_EQ(pages[0].model_name, "developable");
  const auto error = flattening_error(pages[0], pages[0].measured, DogEars::paper);
  EXPECT_LT(error.rms_mm, 0.05);
  EXPECT_NEAR(error.scale, 1, 5e-4);
}

TEST(Developable, IsNotChosenForAFlatPageOrAnOpenBook) {
  const auto plane = [](double x, double y) {
    return std::abs(x) < 90 && std::abs(y) < 120 ? 30 + 0.12 * x - 0.07 * y : nan;
  };
  for (const double noise_mm : {0.02, 0.08, 0.3}) {
    const auto points = measure({plane, 60, 0}, {.width_px = 192, .noise_mm = noise_mm});
    const auto chosen = fit_surface(points), cylinder = fit_surface(points, {.model = SurfaceModel::cylinder});
    ASSERT_EQ(chosen.size(), 1u);
    EXPECT_EQ(chosen[0].model_name, "cylinder");
    EXPECT_TRUE(std::ranges::equal(chosen[0].measured.pixels(), cylinder[0].measured.pixels())) << "no harm is done";
  }
  for (const PageSurface& page : fit_surface(measure(scenes::OpenBook().scene(), {.width_px = 192})))
    EXPECT_EQ(page.model_name, "cylinder");
}

TEST(Developable, DoesLittleHarmToAFlatPageIfForcedUponIt) {
  const auto plane = [](double x, double y) { return std::abs(x) < 90 && std::abs(y) < 120 ? 30.0 : nan; };
  const auto pages = fit_surface(measure({plane, 60, 0}), {.model = SurfaceModel::developable});
  const auto error = flattening_error(pages[0], pages[0].measured, [&](double x, double y) -> Eigen::Vector2d {
    return std::isnan(plane(x, y)) ? no_paper : Eigen::Vector2d(x, -y);
  });
  EXPECT_LT(error.rms_mm, 0.02);
  EXPECT_NEAR(error.scale, 1, 2e-4);
}

TEST(Strain, IsFoundWhereASheetIsNoPaper) {
  // A bump of 8 mm takes some 2 % of stretching: no flattening does away with it.
  const auto bump = [](double x, double y) {
    if (!(std::abs(x) < 80 && std::abs(y) < 90)) return nan;
    return 10 + 8 * std::exp(-(x * x + y * y) / (2 * 14.0 * 14.0));
  };
  const auto flat = [&](double x, double y) { return std::isnan(bump(x, y)) ? nan : 10.0; };
  const auto damaged = fit_surface(measure({bump, 30, 5}, {.width_px = 192}), {.layout = Layout::single});
  const auto whole = fit_surface(measure({flat, 30, 5}, {.width_px = 192}), {.layout = Layout::single});
  EXPECT_GT(summarise_strain(damaged[0]).unexplained_share, 0.02);
  EXPECT_LT(summarise_strain(whole[0]).unexplained_share, 0.002);
  EXPECT_GT(summarise_strain(damaged[0]).rms, 6 * summarise_strain(whole[0]).rms);
}

/// An arched sheet; on a part of it lies something 2 mm thick.
double arch(double x, double y) { return std::abs(x) < 85 && std::abs(y) < 110 ? 20 + 0.0012 * x * x : nan; }
bool has_slip(double x, double y) { return std::abs(x - 30) < 22 && std::abs(y + 20) < 14; }

TEST(Cover, WhatLiesOnThePaperIsMarkedAndThePaperGoesOnBelowIt) {
  const auto height = [](double x, double y) { return arch(x, y) + (has_slip(x, y) ? 2 : 0); };
  for (const SurfaceModel model : {SurfaceModel::cylinder, SurfaceModel::developable}) {
    const auto pages = fit_surface(measure({height, 50, 8}), {.model = model, .layout = Layout::single});
    ASSERT_EQ(pages.size(), 1u);
    const PageSurface& page = pages[0];
    int inside = 0, marked = 0, wrong = 0;
    for (int j = 0; j < page.rows(); ++j)
      for (int i = 0; i < page.columns(); ++i) {
        const Eigen::Vector3f p = page.measured(i, j);
        const bool is_marked = page.status(i, j) == PixelStatus::covered;
        EXPECT_EQ(is_marked, std::isfinite(page.cover_mm(i, j)));
        if (std::isnan(arch(p.x(), p.y()))) continue;
        EXPECT_NEAR(p.z(), arch(p.x(), p.y()), 0.15) << p.transpose();
        if (std::abs(p.x() - 30) < 20 && std::abs(p.y() + 20) < 12) {
          ++inside;
          marked += is_marked;
          if (std::abs(p.x() - 30) < 15 && std::abs(p.y() + 20) < 8) {
            EXPECT_NEAR(page.cover_mm(i, j), 2, 0.2);
          }
        } else if (std::abs(p.x() - 30) > 26.5 || std::abs(p.y() + 20) > 18.5) {  // two cells of these few points
          wrong += is_marked;
        }
      }
    EXPECT_GT(inside, 150);
    EXPECT_GT(marked, 0.95 * inside);
    EXPECT_LT(wrong, 5);
  }
}

TEST(Cover, AFingerIsNoPaperThoughAFewCellsLeadUpToIt) {
  // 12 mm high at the margin, and a ramp 7 mm wide from the paper to its top, as fits across an edge make them.
  const auto rise = [](double x, double y) {
    if (x > 55 && std::abs(y - 10) < 9) return 12.0;
    return x > 20 && std::abs(y - 10) < 3.5 ? 12 * (x - 20) / 35 : 0.0;
  };
  const auto height = [&](double x, double y) { return arch(x, y) + rise(x, y); };
  const auto pages = fit_surface(measure({height, 50, 8}), {.layout = Layout::single});
  ASSERT_EQ(pages.size(), 1u);
  const PageSurface& page = pages[0];
  int inside = 0, marked = 0;
  for (int j = 0; j < page.rows(); ++j)
    for (int i = 0; i < page.columns(); ++i) {
      const Eigen::Vector3f p = page.measured(i, j);
      if (std::isnan(arch(p.x(), p.y())) || (p.x() > 15 && std::abs(p.y() - 10) < 8)) {
        inside += p.x() > 60 && p.x() < 80 && std::abs(p.y() - 10) < 6;
        marked += p.x() > 60 && p.x() < 80 && std::abs(p.y() - 10) < 6 && page.status(i, j) == PixelStatus::covered;
        continue;
      }
      EXPECT_NEAR(p.z(), arch(p.x(), p.y()), 0.3) << p.transpose();
    }
  EXPECT_GT(inside, 30);
  EXPECT_GT(marked, 0.95 * inside);
}

}  // namespace
}  // namespace pagesweep
