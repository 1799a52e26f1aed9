// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/surfacing/local_fit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "pagesweep/base/instruction_sets_testing.h"
#include "pagesweep/surfacing/scenes_for_tests.h"
#include "pagesweep/surfacing/window_sums.h"

namespace pagesweep {
namespace {

/// A window of some cells with anything in them.
Window random_window(std::size_t size) {
  const scenes::Noise noise(5);
  Window window;
  window.reserve(size);
  std::uint64_t counter = 0;
  for (auto* column : {&window.u, &window.v, &window.uu, &window.uv, &window.vv, &window.z, &window.weight,
                       &window.kernel, &window.robust, &window.residual})
    for (std::size_t k = 0; k < size; ++k) (*column)[k] = static_cast<float>(noise.uniform(counter++));
  window.size = size;
  window.pad();
  return window;
}

std::array<double, 6> row_of(const Window& w, std::size_t k) { return {1, w.u[k], w.v[k], w.uu[k], w.uv[k], w.vv[k]}; }

TEST(WindowSums, AgreeWithPlainLoopsOnAllInstructionSets) {
  on_every_instruction_set([&] {
    for (const std::size_t size : {1, 7, 16, 37, 113}) {
      const Window w = random_window(size);
      WindowSums plain;
      for (std::size_t k = 0; k < size; ++k) {
        const auto row = row_of(w, k);
        const double weight = double(w.weight[k]) * w.kernel[k] * w.robust[k];
        for (std::size_t r = 0, at = 0; r < 6; ++r) {
          plain.b[r] += weight * w.z[k] * row[r];
          for (std::size_t c = r; c < 6; ++c, ++at) plain.a[at] += weight * row[r] * row[c];
        }
      }
      const WindowSums sums = add_up(w);
      // Floats have 24 bits, and so many terms of at most 1 are added up.
      const double rounding = 1e-7 * static_cast<double>(size);
      for (std::size_t k = 0; k < 21; ++k) EXPECT_NEAR(sums.a[k], plain.a[k], rounding);
      for (std::size_t k = 0; k < 6; ++k) EXPECT_NEAR(sums.b[k], plain.b[k], rounding);

      std::vector<float> sorted(w.residual.begin(), w.residual.begin() + static_cast<std::ptrdiff_t>(size));
      std::ranges::sort(sorted);
      EXPECT_NEAR(median_residual(w), sorted[size / 2], 5e-3);  // of a mean of 0.5
    }
  });
}

TEST(WindowSums, GatherTheCellsOfACircleOrOfOneSideOfIt) {
  const scenes::Noise noise(3);
  Image<CellMean> cells(30, 21);
  std::uint64_t counter = 0;
  for (CellMean& cell : cells.pixels()) {
    for (float* value : {&cell.p, &cell.q, &cell.z, &cell.pp, &cell.pq, &cell.qq})
      *value = static_cast<float>(noise.uniform(counter++) - 0.5);
    cell.weight = noise.uniform(counter++) < 0.2 ? 0.0f : 2.0f;
  }
  const CellColumns columns(cells);
  on_every_instruction_set([&] {
    for (const WindowPlace& place :
         {WindowPlace{15, 10, 1, 6}, {0, 0, 1, 6}, {29, 20, 1, 5.5}, {13, 4, 1, 6, 0.6, -0.8}}) {
      Window window;
      const double nearest = gather(columns, place, window);
      std::size_t n = 0;
      double should_be_nearest = place.radius_mm;
      for (int j = 0; j < 21; ++j)
        for (int i = 0; i < 30; ++i) {
          const CellMean& cell = cells(i, j);
          const double u = i - place.column + double(cell.p), v = j - place.row + double(cell.q), r = place.radius_mm;
          const bool behind = u * place.towards_p + v * place.towards_q < -0.75;
          if (!(cell.weight > 0) || std::hypot(u, v) >= r || behind) continue;
          should_be_nearest = std::min(should_be_nearest, std::hypot(u, v));
          ASSERT_LT(n, window.size);
          EXPECT_NEAR(window.u[n], u / r, 1e-6);
          EXPECT_NEAR(window.v[n], v / r, 1e-6);
          EXPECT_NEAR(window.uu[n], (u * u + cell.pp) / (r * r), 1e-6);
          EXPECT_NEAR(window.uv[n], (u * v + cell.pq) / (r * r), 1e-6);
          EXPECT_NEAR(window.vv[n], (v * v + cell.qq) / (r * r), 1e-6);
          EXPECT_NEAR(window.z[n] + window.z0_mm, cell.z, 1e-6);
          EXPECT_EQ(window.weight[n], cell.weight);
          EXPECT_NEAR(window.kernel[n], std::pow(1 - (u * u + v * v) / (r * r), 2), 1e-6);
          ++n;
        }
      EXPECT_EQ(window.size, n);
      EXPECT_NEAR(nearest, should_be_nearest, 1e-5);
    }
  });
}

TEST(FitCells, BlendsToWhatFitsOfTheirOwnSay) {
  const double noise_mm = 0.02;
  const scenes::Noise noise(9);
  Image<CellMean> cells(40, 37);
  for (int j = 0; j < 37; ++j)
    for (int i = 0; i < 40; ++i) {
      CellMean& cell = cells(i, j);
      cell.z = static_cast<float>(0.004 * i * i - 0.1 * j + 1e-4 * i * i * j +
                                  noise_mm * noise.gauss(static_cast<std::uint64_t>(40 * j + i)));
      cell.weight = static_cast<float>(1 / (noise_mm * noise_mm));
      cell.count = 1;
    }
  const Image<LocalFit> fits = fit_cells(cells, 1, {.radius_mm = 6}, Image<std::uint8_t>(40, 37, 1));
  const CellColumns columns(cells);
  LocalFitter fitter(columns, 1);
  for (int j = 0; j < 37; ++j)
    for (int i = 0; i < 40; ++i) {
      const LocalFit own = fitter.fit(i, j, {6}, 2);
      ASSERT_TRUE(fits(i, j).ok && own.ok);
      EXPECT_NEAR(fits(i, j).z, own.z, 2 * own.sigma) << i << " " << j;
      // At the border sigma doubles within a few cells, too fast for the lattice.
      const bool full_window = std::min({i, j, 39 - i, 36 - j}) >= 6;
      if (full_window) {
        EXPECT_NEAR(fits(i, j).sigma, own.sigma, 0.2 * own.sigma) << i << " " << j;
      }
    }
}

}  // namespace
}  // namespace pagesweep
