// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <hwy/targets.h>
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>
#include <vector>

#include "pagesweep/matching/sequence_kernels_internal.h"

namespace pagesweep {
namespace {

/// A small picture of random sequences. Parameter: their frames.
class SequenceKernels : public testing::TestWithParam<int> {
 protected:
  static constexpr int width = 37, height = 23;
  const int frames = GetParam();
  const int length = (frames + sequence_padding - 1) / sequence_padding * sequence_padding;
  std::vector<std::int16_t> data;
  std::mt19937 random{7};

  SequenceKernels() : data(static_cast<std::size_t>((width * height + 1) * length)) {
    std::uniform_int_distribution<int> sample(-2000, 2000);
    for (int p = 0; p < width * height; ++p)
      for (int i = 0; i < frames; ++i)
        data[static_cast<std::size_t>(p * length + i)] = static_cast<std::int16_t>(sample(random));
  }
  ~SequenceKernels() override { hwy::SetSupportedTargetsForTest(0); }

  SequenceArrays arrays(const std::int32_t* squares = nullptr) const {
    return {data.data(), squares, length, width, height};
  }
  std::int32_t product(const std::int16_t* a, const std::int16_t* b) const {
    return std::inner_product(a, a + length, b, std::int32_t{0});
  }
  std::vector<std::int32_t> squares() const {
    std::vector<std::int32_t> result;
    for (int p = 0; p <= width * height; ++p) result.push_back(product(arrays().sequence(p), arrays().sequence(p)));
    return result;
  }

  template <class Body>
  static void on_every_target(const Body& body) {
    for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
      SCOPED_TRACE(hwy::TargetName(target));
      hwy::SetSupportedTargetsForTest(target);
      body();
    }
  }
};

const LensNumbers lens{30, 31, 18, 11, -0.05f, 0.02f, 0.001f, 0.002f, -0.001f, 4};
const CurveLine line{-0.9f, 0.3f, 0.031f, -0.012f, 61};  // enters and leaves the picture

/// Where the lens images a place of the line [px].
Eigen::Vector2d picture_of(int place) {
  const double x = line.x + place * static_cast<double>(line.dx), y = line.y + place * static_cast<double>(line.dy);
  const double r2 = x * x + y * y, radial = 1 + r2 * (lens.k1 + r2 * (lens.k2 + r2 * lens.k3));
  return {lens.fx * (x * radial + 2 * lens.p1 * x * y + lens.p2 * (r2 + 2 * x * x)) + lens.cx,
          lens.fy * (y * radial + lens.p1 * (r2 + 2 * y * y) + 2 * lens.p2 * x * y) + lens.cy};
}

TEST_P(SequenceKernels, ScoresAreSquaredDifferencesFromTheNearestPixels) {
  const std::vector<std::int32_t> all_squares = squares();
  const SequenceArrays to = arrays(all_squares.data());
  const std::int16_t* own = to.sequence(5);
  on_every_target([&] {
    std::array<std::int32_t, 64> pixels{}, scores{};
    const std::int32_t least = score_curve(to, lens, line, own, all_squares[5], pixels.data(), scores.data());
    int seen = 0;
    for (int k = 0; k < line.count; ++k) {
      const Eigen::Vector2d p = picture_of(k);
      const bool is_seen = p.x() >= -0.5 && p.y() >= -0.5 && p.x() <= width - 0.5 && p.y() <= height - 0.5;
      const auto pixel = pixels[static_cast<std::size_t>(k)];
      ASSERT_EQ(pixel != to.nowhere(), is_seen) << k;
      seen += is_seen;
      if (is_seen) {
        EXPECT_LE(std::abs(pixel % width - p.x()), 0.501) << k;
        EXPECT_LE(std::abs(pixel / width - p.y()), 0.501) << k;
      }
      std::int64_t expected = 0;
      for (int i = 0; i < length; ++i)
        expected += static_cast<std::int64_t>(std::pow(own[i] - to.sequence(pixel)[i], 2));
      EXPECT_EQ(scores[static_cast<std::size_t>(k)], expected) << k;
    }
    EXPECT_GT(seen, 20);
    EXPECT_LT(seen, line.count);
    EXPECT_EQ(least, *std::min_element(scores.begin(), scores.end()));
  });
}

TEST_P(SequenceKernels, MinimaAreThoseOfTheScoresAndNearerThanThem) {
  const std::vector<std::int32_t> all_squares = squares();
  const SequenceArrays to = arrays(all_squares.data());
  constexpr int count = 45, before = 16;
  std::vector<std::int32_t> pixels, scores(before + 64 + 16, std::numeric_limits<std::int32_t>::max());
  for (int k = 0; k < count; ++k) {
    pixels.push_back(5 * width / 2 + k / 2 * 3);  // some twice
    const std::int16_t* there = to.sequence(pixels.back());
    scores[static_cast<std::size_t>(before + k)] =
        all_squares[2] + all_squares[static_cast<std::size_t>(pixels.back())] - 2 * product(to.sequence(2), there);
  }
  const std::int32_t* first = scores.data() + before;
  std::vector<std::int32_t> sorted(first, first + count);
  std::ranges::sort(sorted);
  const std::int32_t limit = sorted[count * 3 / 4];
  std::vector<int> expected;
  for (int k = 0; k < count; ++k)
    if (first[k] <= limit && first[k] < first[k - 1] && first[k] <= first[k + 1]) expected.push_back(k);
  ASSERT_GT(expected.size(), 4U);
  on_every_target([&] {
    std::array<CurveMinimum, 64> minima{};
    const ScoredCurve curve{&to, pixels.data(), first, count, all_squares[2], false};
    ASSERT_EQ(find_minima(curve, limit, minima.data()), static_cast<int>(expected.size()));
    for (std::size_t i = 0; i < expected.size(); ++i) {
      EXPECT_EQ(minima[i].place, static_cast<float>(expected[i]));
      EXPECT_EQ(minima[i].distance_squared, static_cast<float>(first[expected[i]]));
    }
    improve_minima(curve, std::span(minima).first(expected.size()));
    for (std::size_t i = 0; i < expected.size(); ++i) {
      const auto [place, distance_squared] = minima[i];
      EXPECT_LE(std::abs(place - static_cast<float>(expected[i])), 1);
      const int low = std::min(static_cast<int>(place), count - 2);
      double distance = 0;
      for (int k = 0; k < length; ++k) {
        const double a = to.sequence(pixels[static_cast<std::size_t>(low)])[k];
        const double b = to.sequence(pixels[static_cast<std::size_t>(low + 1)])[k];
        distance += std::pow(to.sequence(2)[k] - a - (place - low) * (b - a), 2);
      }
      EXPECT_NEAR(distance_squared, distance, 1e-4 * all_squares[2]);
      EXPECT_LE(distance_squared, 1.00001 * first[expected[i]]);
    }
  });
}

TEST_P(SequenceKernels, ProductsAreThoseOfTheInterpolatedSequences) {
  const SequenceArrays to = arrays();
  std::array<Crossing, 4> crossings;
  Eigen::MatrixXd s(length, 5);
  for (int i = 0; i < length; ++i) s(i, 0) = to.sequence(9)[i];
  for (int k = 0; k < 4; ++k) {
    const auto share = static_cast<std::int16_t>(k * 10000);
    crossings[static_cast<std::size_t>(k)] = {to.sequence(40 + k), to.sequence(77 + k), share};
    for (int i = 0; i < length; ++i)
      s(i, k + 1) = to.sequence(40 + k)[i] + share / 32768.0 * (to.sequence(77 + k)[i] - to.sequence(40 + k)[i]);
  }
  const Eigen::MatrixXd expected = s.transpose() * s;
  const double rounding = 2000 * std::sqrt(static_cast<double>(frames)) * 4;  // of the interpolated samples
  on_every_target([&] {
    const CrossingProducts products = multiply(crossings.data(), to.sequence(9), length);
    EXPECT_EQ(products.gg, expected(0, 0));
    for (int i = 0; i < 4; ++i) {
      EXPECT_NEAR(products.gs[i], expected(0, i + 1), rounding);
      for (int j = i; j < 4; ++j) EXPECT_NEAR(products.ss[i][j], expected(i + 1, j + 1), rounding);
    }
  });
}

TEST_P(SequenceKernels, ResidualsAreSummedOverTheFrames) {
  const SequenceArrays to = arrays();
  std::array<Crossing, 4> crossings;
  for (int k = 0; k < 4; ++k)
    crossings[static_cast<std::size_t>(k)] = {to.sequence(40 + k), to.sequence(77 + k), 16384};
  const Mixture mixture{crossings.data(), {-0.1f, 0.6f, 0.55f, -0.05f}, {-0.3f, -0.5f, 0.7f, 0.1f}, 0.2f};
  double rr = 0, dd = 0, rrdd = 0;
  for (int i = 0; i < length; ++i) {
    double r = to.sequence(9)[i], d = mixture.change_of_own * r;
    for (int k = 0; k < 4; ++k) {
      const double s = 0.5 * (to.sequence(40 + k)[i] + to.sequence(77 + k)[i]);
      r -= mixture.value[k] * s;
      d += mixture.change[k] * s;
    }
    rr += r * r;
    dd += d * d;
    rrdd += r * r * d * d;
  }
  on_every_target([&] {
    const ResidualSums sums = sum_residuals(mixture, to.sequence(9), length);
    EXPECT_NEAR(sums.rr, rr, 2e-3 * rr);  // interpolated samples are whole numbers
    EXPECT_NEAR(sums.dd, dd, 2e-3 * dd);
    EXPECT_NEAR(sums.rrdd, rrdd, 4e-3 * rrdd);
  });
}

TEST_P(SequenceKernels, PackedSequencesAreNormalised) {
  constexpr int pixels = 19, room = 32;
  constexpr float range = 200;
  std::vector<std::vector<float>> rows(static_cast<std::size_t>(frames), std::vector<float>(room));
  std::vector<const float*> pointers;
  std::uniform_real_distribution<float> gray(-5, 230);
  for (auto& row : rows) {
    for (float& g : row) g = gray(random);
    row[3] = std::numeric_limits<float>::infinity();
    pointers.push_back(row.data());
  }
  for (const bool affine : {false, true})
    on_every_target([&] {
      alignas(64) std::array<float, room> energy, lowest, highest, scale;
      std::vector<std::int16_t> out(static_cast<std::size_t>(pixels * length), 77);
      pack_sequences({pointers, pixels, range}, affine, length, out.data(),
                     {energy.data(), lowest.data(), highest.data(), scale.data()});
      for (std::size_t p = 0; p < pixels; ++p) {
        Eigen::VectorXf g(frames);
        for (int i = 0; i < frames; ++i) g[i] = std::min(range, rows[static_cast<std::size_t>(i)][p]);
        EXPECT_EQ(lowest[p], g.minCoeff());
        EXPECT_EQ(highest[p], g.maxCoeff());
        const float mean = g.mean(), expected_energy = (g.array() - mean).matrix().squaredNorm();
        EXPECT_NEAR(energy[p], expected_energy, 1e-4f * range * range);
        const float size =
            affine ? std::sqrt(std::max(expected_energy, 1e-6f)) : range * std::sqrt(static_cast<float>(frames));
        if (p != 3) {
          EXPECT_NEAR(scale[p], sequence_scale / size, 1e-4f * scale[p]);
        }
        for (int i = 0; i < length; ++i) {
          const float stored = i < frames ? scale[p] * (g[i] - (affine ? mean : 0)) : 0;
          EXPECT_NEAR(out[p * static_cast<std::size_t>(length) + static_cast<std::size_t>(i)], stored, 0.51)
              << p << ' ' << i;
        }
      }
    });
}

INSTANTIATE_TEST_SUITE_P(Frames, SequenceKernels, testing::Values(13, 32, 40),
                         [](const auto& test) { return std::to_string(test.param); });

}  // namespace
}  // namespace pagesweep
