// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/shift_equations.h"

#include <gtest/gtest.h>

#include <Eigen/QR>
#include <limits>

#include "pagesweep/timing/stripe_pixel_testing.h"

namespace pagesweep {
namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();
constexpr float nan = std::numeric_limits<float>::quiet_NaN();

TEST(SolveShift, SolvesASystemThatWasWorkedOutByHand) {
  // g(t) = 2 f(t - 2.25) + 3 with f a ramp and a step back, so that linear interpolation is exact wherever eq. 4 is
  // used: f = k^2 needs differences that vary, else c and b could not be told apart. With c~ = 2 and c = 2.25 the row
  // a f_k + b = g_k + 0.25 (g_{k+1} - g_k) is met exactly by g_0 = 10 and g_{k+1} = g_k + 4 (2 f_k + 3 - g_k).
  const std::vector<float> f{4, 5, 7, 6, 4.5F};
  std::vector<float> g{0, 0, 10};
  for (const float f_k : f) g.push_back(g.back() + 4 * (2 * f_k + 3 - g.back()));
  const auto shift = solve_shift(f, g, 2);
  ASSERT_TRUE(shift);
  EXPECT_EQ(shift->rows, 5);
  EXPECT_NEAR(shift->a, 2, 1e-9);
  EXPECT_NEAR(shift->b, 3, 1e-8);
  EXPECT_NEAR(shift->c, 2.25, 1e-9);
  EXPECT_NEAR(shift->residual_rms, 0, 1e-5);
}

TEST(SolveShift, AgreesWithAnIndependentSolverOfEquation8) {
  const auto shape = testing::gaussian(4);
  const auto f = testing::expose(shape, {.amplitude = 150, .time = 30}, {}, 60, 1);
  const auto g = testing::expose(shape, {.amplitude = 110, .time = 36.4}, {}, 60, 2);
  const int start = 6, rows = 53;
  Eigen::MatrixXd a(rows, 3);
  Eigen::VectorXd b(rows);
  for (int k = 0; k < rows; ++k) {  // the matrix as printed, whose third unknown is -c
    const double step = double(g[std::size_t(k + start + 1)]) - g[std::size_t(k + start)];
    a.row(k) << f[std::size_t(k)], 1, step;
    b(k) = g[std::size_t(k + start)] - start * step;
  }
  const Eigen::Vector3d x = a.colPivHouseholderQr().solve(b);
  const auto shift = solve_shift(f, g, start);
  ASSERT_TRUE(shift);
  EXPECT_EQ(shift->rows, rows);
  EXPECT_NEAR(shift->a, x(0), 1e-9);
  EXPECT_NEAR(shift->b, x(1), 1e-7);
  EXPECT_NEAR(shift->c, -x(2), 1e-9);
  EXPECT_NEAR(shift->residual_rms, (a * x - b).norm() / std::sqrt(double(rows)), 1e-6);
}

TEST(SolveShift, SkipsExactlyTheRowsOfEquations10And11) {
  // f: last good sample before the plateau k1 = 4, first good one after it k2 = 7. g in the rows' own index: t1 = 3,
  // t2 = 6. Eq. 11: i = min(k1, t1 - 1) = 2, j = max(k2, t2) = 7; rows 0..2 and 7..11 stay.
  const std::vector<float> f{1, 2, 5, 9, 14, infinity, infinity, 15, 10, 6, 3, 2};
  const std::vector<float> g{1, 3, 6, 11, infinity, infinity, 14, 10, 7, 3, 2, 1, 1};
  const auto shift = solve_shift(f, g, 0);
  ASSERT_TRUE(shift);
  EXPECT_EQ(shift->rows, 3 + 5);
  std::vector<float> without_middle = f;
  for (int k = 3; k < 7; ++k) without_middle[std::size_t(k)] = nan;  // the same rows named by hand
  std::vector<float> g_without = g;
  g_without[4] = g_without[5] = 12;
  const auto by_hand = solve_shift(without_middle, g_without, 0);
  ASSERT_TRUE(by_hand);
  EXPECT_EQ(shift->c, by_hand->c);
}

TEST(SolveShift, SaysWhenTheRowsDoNotDetermineTheTime) {
  const std::vector<float> f{1, 2, 3, 4, 5, 6}, flat(7, 5.0F), line{1, 2, 3, 4, 5, 6, 7};
  EXPECT_FALSE(solve_shift(f, flat, 0));  // g never changes
  EXPECT_FALSE(solve_shift(f, line, 0));  // a ramp against a ramp: time and background are the same thing
  EXPECT_FALSE(solve_shift(std::vector<float>{1, 4, 2}, line, 0));
  EXPECT_FALSE(solve_shift(f, line, 100));
  EXPECT_FALSE(solve_shift(std::vector<float>(6, nan), line, 0));
}

TEST(PeakPosition, TakesTheMiddleOfAPlateauAndIgnoresDroppedFrames) {
  EXPECT_EQ(peak_position(std::vector<float>{1, nan, 3, 9, nan, 2}), 3);
  EXPECT_EQ(peak_position(std::vector<float>{1, 5, infinity, infinity, nan, infinity, infinity, 5}), 4);
  EXPECT_EQ(peak_position(std::vector<float>{nan, nan}), -1);
}

TEST(RefineShift, FindsTheIntervalFromAStartThatIsFramesOff) {
  const auto shape = testing::gaussian(4);
  const auto f = testing::expose(shape, {.amplitude = 200, .time = 30}, {}, 60, 1);
  const auto g = testing::expose(shape, {.amplitude = 200, .time = 31.6}, {}, 60, 2);
  for (const int start : {-4, -1, 0, 1, 2, 5}) {
    const auto shift = refine_shift(f, g, start);
    ASSERT_TRUE(shift);
    EXPECT_NEAR(shift->c, 1.6, 0.12) << start;  // 4 sigma of two noisy bells
  }
}

}  // namespace
}  // namespace pagesweep
