// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/sequence_kernels_internal.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <vector>

#include "pagesweep/base/instruction_sets_testing.h"
#include "pagesweep/matching/sequence_search_internal.h"

namespace pagesweep {
namespace {

/// A small picture of random sequences. Parameter: their frames.
class SequenceKernels : public testing::TestWithParam<int> {
 protected:
  static constexpr int width = 37, height = 23, stride = 64;
  const int frames = GetParam(), pairs = (frames + 1) / 2;
  std::vector<std::int32_t> data, own, next;
  std::mt19937 random{7};

  SequenceKernels()
      : data(static_cast<std::size_t>(height * pairs * stride)),
        own(static_cast<std::size_t>(height * stride)),
        next(own.size()) {
    std::uniform_int_distribution<int> sample(-2000, 2000);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x)
        for (int i = 0; i < frames; ++i) set(x, y, i, static_cast<std::int16_t>(sample(random)));
    for (int y = 0; y < height; ++y)
      multiply_neighbours(arrays(), y, &own[static_cast<std::size_t>(y * stride)],
                          &next[static_cast<std::size_t>(y * stride)]);
  }

  void set(int x, int y, int frame, std::int16_t value) {
    auto* pair = reinterpret_cast<char*>(data.data() + (arrays().sequence(y, x) - data.data()) + frame / 2 * stride);
    std::memcpy(pair + 2 * (frame % 2), &value, 2);
  }
  /// Lines are rows.
  SequenceArrays arrays(bool along_rows = true) const {
    return {data.data(), own.data(), own.data(), next.data(), pairs, stride, height, width, along_rows};
  }
  Eigen::VectorXd sequence(std::int32_t index) const {
    Eigen::VectorXd values(frames);
    for (int i = 0; i < frames; ++i) {
      const std::int32_t pair = arrays().sequence(index)[i / 2 * stride];
      values[i] = static_cast<std::int16_t>(i % 2 == 0 ? pair : pair >> 16);
    }
    return values;
  }
  Eigen::VectorXd sequence(int x, int y) const { return sequence(arrays().index(y, x)); }
  std::vector<std::int32_t> copy(int x, int y) const {
    std::vector<std::int32_t> result;
    for (int j = 0; j < pairs; ++j) result.push_back(arrays().sequence(y, x)[j * stride]);
    return result;
  }
};

const LensNumbers lens{30, 31, 18, 11, -0.05f, 0.02f, 0.001f, 0.002f, -0.001f, 4};
const CurveFrame frame{lens, {0.9, -0.35, 0.05}, {-0.65, -0.4}, {0.65, 0.4}, -2, 2};

/// Where the lens images ideal coordinates [px].
Eigen::Vector2d picture_of(double x, double y) {
  const double r2 = x * x + y * y, radial = 1 + r2 * (lens.k1 + r2 * (lens.k2 + r2 * lens.k3));
  return {lens.fx * (x * radial + 2 * lens.p1 * x * y + lens.p2 * (r2 + 2 * x * x)) + lens.cx,
          lens.fy * (y * radial + lens.p1 * (r2 + 2 * y * y) + 2 * lens.p2 * x * y) + lens.cy};
}

LineBatch lines_of_some_pixels(bool along_rows) {
  LineBatch batch;
  for (std::size_t k = 0; k < LineBatch::most; ++k) {
    batch.direction[0][k] = -0.3 + 0.03 * static_cast<double>(k);
    batch.direction[1][k] = 0.2 - 0.02 * static_cast<double>(k);
    batch.direction[2][k] = 1;
  }
  batch.direction[0][9] = std::numeric_limits<double>::quiet_NaN();
  lay_lines(frame, along_rows, batch);
  return batch;
}

TEST_P(SequenceKernels, LinesEndWhereThePictureDoesOrTheDepths) {
  on_every_instruction_set([&] {
    const LineBatch batch = lines_of_some_pixels(true);
    EXPECT_EQ(batch.count[9], 0);
    for (std::size_t k = 0; k < LineBatch::most; ++k) {
      if (k == 9) continue;
      ASSERT_GT(batch.count[k], 10);
      const auto at = [&](double w) {
        const double z = batch.direction[2][k] + w * frame.origin[2];
        return Eigen::Vector2d((batch.direction[0][k] + w * frame.origin[0]) / z,
                               (batch.direction[1][k] + w * frame.origin[1]) / z);
      };
      const double steps = batch.count[k] - 1;
      const Eigen::Vector2d first(batch.x[k], batch.y[k]), step(batch.dx[k], batch.dy[k]);
      EXPECT_LT((at(batch.far[k]) - first).norm(), 1e-5);
      EXPECT_LT((at(batch.near[k]) - (first + steps * step)).norm(), 1e-5);
      EXPECT_NEAR(Eigen::Vector2d(lens.fx * step.x(), lens.fy * step.y()).norm(), 1, 0.1);
      for (const Eigen::Vector2d& end : {first, Eigen::Vector2d(first + steps * step)})
        for (int i = 0; i < 2; ++i) {
          EXPECT_GE(end[i], frame.lowest[static_cast<std::size_t>(i)] - 1e-5);
          EXPECT_LE(end[i], frame.highest[static_cast<std::size_t>(i)] + 1e-5);
        }
    }
  });
}

/// Across the picture's lines, none of the curves can be compared in runs.
TEST_P(SequenceKernels, ScoresAreSquaredDifferencesFromTheNearestPixels) {
  for (const bool along_rows : {true, false})
    on_every_instruction_set([&] {
      const SequenceArrays to = arrays(along_rows);
      const std::vector<std::int32_t> g = copy(5, 1);
      const OwnSequence own_sequence{g.data(), 1, own[static_cast<std::size_t>(to.index(1, 5))]};
      const LineBatch batch = lines_of_some_pixels(along_rows);
      ScoredCurve curve;
      for (const std::size_t k : {0U, 4U, 12U}) {
        const CurveLine line = batch.line(k);
        score_curve(to, lens, line, own_sequence, curve);
        int seen = 0;
        std::int32_t least = std::numeric_limits<std::int32_t>::max();
        for (int entry = 0; entry < curve.count; ++entry) {
          const std::int32_t pixel = curve.pixel_at(entry);
          if (pixel < 0) continue;
          ++seen;
          const double step = curve.share_at(static_cast<float>(entry)) * (line.count - 1);
          const Eigen::Vector2d p = picture_of(line.x + step * line.dx, line.y + step * line.dy);
          EXPECT_LE(std::abs(pixel % stride - (along_rows ? p.x() : p.y())), 0.62) << entry;
          EXPECT_LE(std::abs(pixel / stride - (along_rows ? p.y() : p.x())), 0.62) << entry;
          const double expected = (sequence(5, 1) - sequence(pixel)).squaredNorm();
          EXPECT_EQ(curve.first_score()[entry], expected) << entry;
          least = std::min(least, curve.first_score()[entry]);
        }
        EXPECT_GT(seen, 10);
        EXPECT_EQ(curve.least, least);
      }
    });
}

TEST_P(SequenceKernels, MinimaAreThoseOfTheScoresAndNearerThanThem) {
  constexpr int count = 35, row = 3;
  ScoredCurve curve;
  curve.count = count;
  curve.pixels.assign(score_padding + 64 + score_padding, -1);
  for (int k = 0; k < count; ++k)
    curve.pixels[static_cast<std::size_t>(score_padding + k)] = arrays().index(k < 20 ? row : row + 1, k);
  curve.scores.assign(score_padding + 64 + score_padding, std::numeric_limits<std::int32_t>::max());
  const Eigen::VectorXd g = sequence(2, 9);
  for (int k = 0; k < count; ++k)
    curve.scores[static_cast<std::size_t>(score_padding + k)] =
        static_cast<std::int32_t>((g - sequence(curve.pixel_at(k))).squaredNorm());
  const std::int32_t* first = curve.first_score();
  std::vector<std::int32_t> sorted(first, first + count);
  std::ranges::sort(sorted);
  const std::int32_t limit = sorted[count * 3 / 4];
  std::vector<int> expected;
  for (int k = 0; k < count; ++k)
    if (first[k] <= limit && first[k] < first[k - 1] && first[k] <= first[k + 1]) expected.push_back(k);
  ASSERT_GT(expected.size(), 4U);
  on_every_instruction_set([&] {
    CurveMinima minima;
    find_minima(curve, limit, minima);
    ASSERT_EQ(minima.count, static_cast<int>(expected.size()));
    improve_minima(arrays(), curve, static_cast<std::int32_t>(g.squaredNorm()), false, minima);
    for (std::size_t i = 0; i < expected.size(); ++i) {
      const int at = expected[i], beside = first[at - 1] < first[at + 1] ? at - 1 : at + 1;
      EXPECT_EQ(minima.place[i], at);
      EXPECT_EQ(minima.score[i], first[at]);
      EXPECT_EQ(minima.beside[i], beside);
      EXPECT_EQ(minima.beside_score[i], first[beside]);
      const float place = minima.improved_place[i];
      EXPECT_GE(place, std::min(at, beside));
      EXPECT_LE(place, std::max(at, beside));
      const int low = std::min(static_cast<int>(place), count - 2);
      const Eigen::VectorXd a = sequence(curve.pixel_at(low)), b = sequence(curve.pixel_at(low + 1));
      EXPECT_NEAR(minima.distance_squared[i], (g - a - (place - static_cast<float>(low)) * (b - a)).squaredNorm(),
                  1e-4 * g.squaredNorm());
      EXPECT_LE(minima.distance_squared[i], 1.00001 * first[at]);
    }
  });
}

TEST_P(SequenceKernels, NeighboursAreMultiplied) {
  on_every_instruction_set([&] {
    std::vector<std::int32_t> with_own(stride), with_next(stride);
    multiply_neighbours(arrays(), 4, with_own.data(), with_next.data());
    for (int x = 0; x + 1 < width; ++x) {
      EXPECT_EQ(with_own[static_cast<std::size_t>(x)], sequence(x, 4).squaredNorm());
      EXPECT_EQ(with_next[static_cast<std::size_t>(x)], sequence(x, 4).dot(sequence(x + 1, 4)));
    }
  });
}

/// Between two lines each, side by side or not.
Crossings some_crossings(const SequenceArrays& to, bool are_neighbours, const std::int32_t* shares) {
  Crossings crossings{{}, {}, are_neighbours, shares};
  for (int k = 0; k < Crossings::count; ++k) {
    const int line = are_neighbours ? 6 : 6 + k / 2;
    crossings.low[static_cast<std::size_t>(k)] = to.sequence(line, 11 + k);
    crossings.high[static_cast<std::size_t>(k)] = to.sequence(line + 1, 11 + k);
  }
  return crossings;
}

constexpr std::array<std::int32_t, Crossings::count> shares = {0, 10000, 20000, 30000};
std::array<std::int32_t, Crossings::count> in_both_halves() {
  std::array<std::int32_t, Crossings::count> both{};
  for (std::size_t k = 0; k < both.size(); ++k) both[k] = shares[k] * 0x10001;
  return both;
}

TEST_P(SequenceKernels, ProductsAreThoseOfTheInterpolatedSequences) {
  const auto both = in_both_halves();
  const std::vector<std::int32_t> g = copy(9, 2);
  const double rounding = 2000 * std::sqrt(static_cast<double>(frames)) * 4;  // of the interpolated samples
  for (const bool are_neighbours : {true, false}) {
    Eigen::MatrixXd s(frames, 4);
    for (int k = 0; k < 4; ++k) {
      const int line = are_neighbours ? 6 : 6 + k / 2;
      const double share = shares[static_cast<std::size_t>(k)] / 32768.0;
      s.col(k) = (1 - share) * sequence(11 + k, line) + share * sequence(11 + k, line + 1);
    }
    const Eigen::MatrixXd expected = s.transpose() * s;
    const Eigen::VectorXd with_g = s.transpose() * sequence(9, 2);
    on_every_instruction_set([&] {
      const Crossings crossings = some_crossings(arrays(), are_neighbours, both.data());
      const CrossingProducts products = multiply(arrays(), crossings, {g.data(), 1, 0});
      for (int i = 0; i < 4; ++i) {
        EXPECT_NEAR(products.gs[i], with_g[i], rounding);
        for (int j = i; j < 4; ++j) EXPECT_NEAR(products.ss[i][j], expected(i, j), rounding);
      }
    });
  }
}

TEST_P(SequenceKernels, ResidualsAreSummedOverTheFrames) {
  const auto both = in_both_halves();
  const std::vector<std::int32_t> g = copy(9, 2);
  constexpr std::array<float, 4> value = {-0.1f, 0.6f, 0.55f, -0.05f}, change = {-0.3f, -0.5f, 0.7f, 0.1f};
  constexpr float change_of_own = 0.2f;
  Eigen::VectorXd r = sequence(9, 2), d = change_of_own * r;
  for (int k = 0; k < 4; ++k) {
    const auto i = static_cast<std::size_t>(k);
    const double share = shares[i] / 32768.0;
    const Eigen::VectorXd s = (1 - share) * sequence(11 + k, 6) + share * sequence(11 + k, 7);
    r -= value[i] * s;
    d += change[i] * s;
  }
  const double expected = (r.array() * d.array()).matrix().squaredNorm();
  on_every_instruction_set([&] {
    for (const std::size_t pixel : {0U, 7U, 15U}) {
      MixtureBatch batch;
      batch.own.resize(static_cast<std::size_t>(pairs) * MixtureBatch::most);
      batch.crossings.resize(batch.own.size() * Crossings::count);
      for (std::size_t k = 0; k < 4; ++k) {
        batch.value[k][pixel] = value[k];
        batch.change[k][pixel] = change[k];
      }
      batch.change_of_own[pixel] = change_of_own;
      enter(arrays(), some_crossings(arrays(), true, both.data()), {g.data(), 1, 0}, pixel, batch);
      sum_weighted_residuals(pairs, batch);
      EXPECT_NEAR(batch.rrdd[pixel], expected, 4e-3 * expected);  // interpolated samples are whole numbers
    }
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
    for (const bool side_by_side : {false, true})
      on_every_instruction_set([&] {
        alignas(64) std::array<float, room> energy, lowest, highest, scale;
        std::vector<std::int32_t> out(static_cast<std::size_t>(room * pairs), 77);
        const std::ptrdiff_t pair_step = side_by_side ? room : 1, pixel_step = side_by_side ? 1 : pairs;
        pack_sequences(GrayRows{pointers, pixels, range}, affine, {out.data(), pair_step, pixel_step},
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
          for (int i = 0; i < 2 * pairs; ++i) {
            const std::int32_t pair =
                out[static_cast<std::size_t>(static_cast<std::ptrdiff_t>(p) * pixel_step + i / 2 * pair_step)];
            const float stored = i < frames ? scale[p] * (g[i] - (affine ? mean : 0)) : 0;
            EXPECT_NEAR(static_cast<std::int16_t>(i % 2 == 0 ? pair : pair >> 16), stored, 0.51) << p << ' ' << i;
          }
        }
      });
}

TEST_P(SequenceKernels, BytesArePackedAsTheirGrayValues) {
  constexpr int pixels = 32;
  constexpr float black_level = 4, range = 200;
  std::vector<std::vector<std::uint8_t>> bytes(static_cast<std::size_t>(frames), std::vector<std::uint8_t>(pixels));
  std::vector<std::vector<float>> grays(bytes.size(), std::vector<float>(pixels));
  std::vector<const std::uint8_t*> byte_rows;
  std::vector<const float*> gray_rows;
  std::uniform_int_distribution<int> gray(0, 255);
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    for (std::uint8_t& b : bytes[i]) b = static_cast<std::uint8_t>(gray(random));
    std::ranges::transform(bytes[i], grays[i].begin(), [](std::uint8_t b) { return b - black_level; });
    byte_rows.push_back(bytes[i].data());
    gray_rows.push_back(grays[i].data());
  }
  on_every_instruction_set([&] {
    alignas(64) std::array<std::array<float, pixels>, 4> known, expected_known;
    const auto numbers = [](auto& s) { return SequenceStatistics{s[0].data(), s[1].data(), s[2].data(), s[3].data()}; };
    std::vector<std::int32_t> out(static_cast<std::size_t>(pixels * pairs)), expected = out;
    pack_sequences(ByteRows{byte_rows, pixels, range, black_level}, true, {out.data(), pixels, 1}, numbers(known));
    pack_sequences(GrayRows{gray_rows, pixels, range}, true, {expected.data(), pixels, 1}, numbers(expected_known));
    EXPECT_EQ(out, expected);
    EXPECT_EQ(known, expected_known);
  });
}

INSTANTIATE_TEST_SUITE_P(Frames, SequenceKernels, testing::Values(13, 32, 40),
                         [](const auto& test) { return std::to_string(test.param); });

}  // namespace
}  // namespace pagesweep
