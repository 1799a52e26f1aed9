// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/base/local_plane.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "pagesweep/base/instruction_sets_testing.h"

namespace pagesweep {
namespace {

constexpr float nan = std::numeric_limits<float>::quiet_NaN();

Image<float> ramp() {
  Image<float> image(20, 20);
  for (int y = 0; y < 20; ++y)
    for (int x = 0; x < 20; ++x) image(x, y) = 100 + 0.5f * static_cast<float>(x) - 0.25f * static_cast<float>(y);
  return image;
}

TEST(LocalPlane, IsExactAlsoAtBordersAndBesideHoles) {
  Image<float> image = ramp();
  image(9, 10) = nan;
  for (const auto& [x, y] : {std::pair{10, 10}, {0, 0}, {19, 7}, {7, 19}}) {
    const auto plane = fit_plane(image, x, y, 3);
    ASSERT_TRUE(plane);
    EXPECT_NEAR(plane->across, 0.5, 1e-5);
    EXPECT_NEAR(plane->down, -0.25, 1e-5);
    EXPECT_NEAR(plane->middle, 0, 1e-5);
  }
}

TEST(LocalPlane, LeavesAnotherSurfaceOut) {
  Image<float> image = ramp();
  for (int y = 12; y < 20; ++y)
    for (int x = 12; x < 20; ++x) image(x, y) += 1;
  EXPECT_NEAR(fit_plane(image, 10, 10, 3)->across, 0.5, 1e-4);
}

TEST(LocalPlane, IsNotThereForTooFewValuesOrALine) {
  Image<float> line(20, 20, nan);
  for (int x = 0; x < 20; ++x) line(x, 10) = 1;
  EXPECT_FALSE(fit_plane(line, 10, 10, 3));
}

/// Noise on a slope, a step, and holes.
class PlaneFitterTest : public testing::Test {
 protected:
  static constexpr int radius = 2;
  Image<float> values{45, 30}, sigmas{45, 30, 0.1f};

  PlaneFitterTest() {
    std::mt19937 random(7);
    std::normal_distribution<float> noise(0, 0.1f);
    for (int y = 0; y < values.height(); ++y)
      for (int x = 0; x < values.width(); ++x) {
        const float step = x > 25 && y > 15 ? 4.f : 0.f;
        values(x, y) = random() % 11 == 0 ? nan : 50 + 0.3f * static_cast<float>(x) + step + noise(random);
      }
  }

  struct Place {
    double i, j, value, sigma;
  };
  std::vector<Place> around(int x, int y) const {
    std::vector<Place> places;
    for (int j = -radius; j <= radius; ++j)
      for (int i = -radius; i <= radius; ++i)
        if (values.contains(x + i, y + j) && std::isfinite(values(x + i, y + j)))
          places.push_back({1.0 * i, 1.0 * j, 1.0 * values(x + i, y + j) - values(x, y), sigmas(x + i, y + j)});
    return places;
  }
  struct Plane {
    double across, down, middle;
    double miss(const Place& p) const { return std::abs(p.value - across * p.i - down * p.j - middle); }
  };
  /// By Cramer's rule.
  static Plane fit(const std::vector<Place>& places) {
    double n = 0, i = 0, j = 0, ii = 0, ij = 0, jj = 0, d = 0, id = 0, jd = 0;
    for (const Place& p : places) {
      n += 1, i += p.i, j += p.j, ii += p.i * p.i, ij += p.i * p.j, jj += p.j * p.j;
      d += p.value, id += p.i * p.value, jd += p.j * p.value;
    }
    const auto det = [](double a, double b, double c, double e, double f, double g, double h, double k, double l) {
      return a * (f * l - g * k) - b * (e * l - g * h) + c * (e * k - f * h);
    };
    const double all = det(ii, ij, i, ij, jj, j, i, j, n);
    return {det(id, ij, i, jd, jj, j, d, j, n) / all, det(ii, id, i, ij, jd, j, i, d, n) / all,
            det(ii, ij, id, ij, jj, jd, i, j, d) / all};
  }

  void expect_plain_fits(const PlaneBatch& planes, const PlaneBatch::Each<bool>& are_one_surface) {
    for (std::size_t k = 0; k < planes.count; ++k) {
      SCOPED_TRACE(std::to_string(planes.column[k]) + ", " + std::to_string(planes.row));
      auto places = around(planes.column[k], planes.row);
      EXPECT_EQ(planes.size[k], static_cast<float>(places.size()));
      if (places.size() < 8) continue;
      Plane plane = fit(places);
      std::vector<double> misses;
      for (const Place& p : places) misses.push_back(plane.miss(p));
      std::ranges::sort(misses);
      const double median = misses[misses.size() / 2], largest = misses.back();
      EXPECT_GE(planes.median[k], median - 1e-5);
      EXPECT_LE(planes.median[k], 1.01 * median + 1e-5);
      const auto near = [&](double a, double b) { return std::abs(a - b) < 0.02 * b; };
      if (near(largest, 3 * median)) continue;
      const bool on_the_verge = std::ranges::any_of(misses, [&](double miss) { return near(miss, 3 * median); });
      if (largest > 3 * median) {
        if (on_the_verge) continue;
        std::erase_if(places, [&, first = plane](const Place& p) { return first.miss(p) > 3 * median; });
        plane = fit(places);
      }
      ASSERT_TRUE(planes.found(k));
      EXPECT_NEAR(planes.across[k], plane.across, 1e-4);
      EXPECT_NEAR(planes.down[k], plane.down, 1e-4);
      EXPECT_NEAR(planes.middle[k], plane.middle, 1e-4);
      bool one_surface = true;
      for (const Place& p : around(planes.column[k], planes.row))
        one_surface = one_surface && plane.miss(p) <= 0.5 * std::hypot(plane.across, plane.down) + 6 * p.sigma;
      EXPECT_EQ(are_one_surface[k], one_surface);
    }
  }
};

TEST_F(PlaneFitterTest, FitsAsAPlainLoopDoesOnAllInstructionSets) {
  on_every_instruction_set([&] {
    PlaneFitter fitter(radius);
    int fitted = 0, on_one_surface = 0;
    for (int y = 0; y < values.height(); ++y) {
      const auto is_wanted = [&](int x) { return std::isfinite(values(x, y)) && (y % 2 == 0 || x % 3 == 0); };
      in_batches(values.width(), y, is_wanted, [&](PlaneBatch& planes) {
        fitter.fit(values, planes);
        const auto are_one_surface = fitter.are_one_surface(sigmas, planes);
        expect_plain_fits(planes, are_one_surface);
        fitted += static_cast<int>(planes.count);
        on_one_surface +=
            static_cast<int>(std::count(are_one_surface.begin(), are_one_surface.begin() + planes.count, true));
      });
    }
    EXPECT_GT(fitted, 700);
    EXPECT_GT(on_one_surface, 500);
    EXPECT_LT(on_one_surface, fitted - 30);  // the step
  });
}

}  // namespace
}  // namespace pagesweep
