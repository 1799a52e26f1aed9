// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/nearest_place.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <limits>
#include <random>

#include "pagesweep/base/instruction_sets_testing.h"

namespace pagesweep {
namespace {

constexpr int frames = 12;
using Sequence = Eigen::Matrix<double, frames, 1>;
using Sequences = Eigen::Matrix<double, frames, 4>;

/// Waves that travel with the place, without mean.
Sequence pattern(double place) {
  Sequence s;
  for (int i = 0; i < frames; ++i)
    s[i] = 100 * std::sin(0.5 * place + 2.4 * i) + 60 * std::sin(0.3 * place - 1.1 * i * i);
  return s.array() - s.mean();
}

Sequences crossings() {
  Sequences s;
  for (int i = 0; i < 4; ++i) s.col(i) = pattern(i);
  return s;
}

Sequence combine(const Sequences& s, const std::array<double, 4>& weights) {
  return s * Eigen::Map<const Eigen::Vector4d>(weights.data());
}

double distance_squared(const Sequence& g, const Sequence& s, bool affine) {
  const double gain = affine ? std::max(0.0, g.dot(s) / s.squaredNorm()) : 1;
  return (g - gain * s).squaredNorm();
}

void load(const Sequence& g, const Sequences& s, double noise_share, std::size_t lane, PlaceBatch& batch) {
  batch.gg[lane] = g.squaredNorm();
  for (int i = 0; i < 4; ++i) {
    const auto k = static_cast<std::size_t>(i);
    batch.gs[k][lane] = g.dot(s.col(i));
    batch.noise_share[k][lane] = noise_share;
    batch.usable[k][lane] = 1;
    for (int j = i; j < 4; ++j) batch.ss[k][static_cast<std::size_t>(j)][lane] = s.col(i).dot(s.col(j));
  }
}

/// The least of a function of the share, sought in steps of a thousandth.
template <class Function>
double share_of_least(const Function& function) {
  double best = 0;
  for (int i = 0; i <= 1000; ++i)
    if (function(1e-3 * i) < function(best)) best = 1e-3 * i;
  return best;
}

class NearestPlace : public testing::TestWithParam<Normalisation> {
 protected:
  static constexpr double sigma = 5;
  const bool affine = GetParam() == Normalisation::affine;
  const Sequences s = crossings();
  PlaceBatch batch;

  NearestPlace() {
    batch.samples = frames;
    batch.freedom = frames - 3;
  }

  Sequence seen_from(double place) const { return (affine ? 1.3 : 1.0) * pattern(place); }
  Sequence noisy(double place, unsigned seed) const {
    std::mt19937 random(seed);
    std::normal_distribution<double> noise(0, sigma);
    Sequence g = seen_from(place);
    for (int i = 0; i < frames; ++i) g[i] += noise(random);
    return g.array() - g.mean();
  }
  /// Of lane k, on all instruction sets.
  template <class Body>
  void on_each(Interpolation interpolation, const Body& body) {
    on_every_instruction_set([&] {
      find_nearest_places(batch, GetParam(), interpolation);
      for (std::size_t k = 0; k < batch.count; ++k) body(k);
    });
  }
};

TEST_P(NearestPlace, IsTheBestOfAllOnTheLine) {
  std::array<Sequence, PlaceBatch::most> g;
  for (unsigned k = 0; k < g.size(); ++k) load(g[k] = noisy(1 + k / 15.0, k), s, 0, k, batch);
  on_each(Interpolation::linear, [&](std::size_t k) {
    const auto at = [&](double share) {
      return distance_squared(g[k], combine(s, linear_weights(share).value), affine);
    };
    const double best = share_of_least(at);
    EXPECT_NEAR(batch.share[k], best, 1e-3);
    EXPECT_LE(batch.distance_squared[k], at(best) + 1e-6 * batch.gg[k]);
    EXPECT_NEAR(batch.distance_squared[k], at(batch.share[k]), 1e-6 * batch.gg[k]);
    EXPECT_EQ(batch.is_cubic[k], 0);
    EXPECT_NEAR(batch.noise_variance[k], batch.distance_squared[k] / batch.freedom, 1e-6 * batch.distance_squared[k]);
  });
}

TEST_P(NearestPlace, IsTheBestOfAllOnTheSpline) {
  std::array<Sequence, PlaceBatch::most> g;
  for (unsigned k = 0; k < g.size(); ++k) load(g[k] = noisy(1 + k / 15.0, k), s, 0, k, batch);
  on_each(Interpolation::cubic, [&](std::size_t k) {
    const auto at = [&](double share) {
      return distance_squared(g[k], combine(s, cubic_weights(share).value), affine);
    };
    const double best = share_of_least(at);
    EXPECT_NEAR(batch.share[k], best, 1e-2);
    EXPECT_LE(batch.distance_squared[k], at(best) + 1e-4 * batch.gg[k]);
    EXPECT_NEAR(batch.distance_squared[k], at(batch.share[k]), 1e-6 * batch.gg[k]);
    EXPECT_EQ(batch.is_cubic[k], 1);
  });
}

TEST_P(NearestPlace, FindsThePlaceOfASmoothPattern) {
  for (unsigned k = 0; k < PlaceBatch::most; ++k) load(seen_from(1 + k / 15.0), s, 0, k, batch);
  double squares = 0;
  const auto add_error = [&](std::size_t k) { squares += std::pow(1 + batch.share[k] - (1 + k / 15.0), 2); };
  on_each(Interpolation::linear, add_error);
  const double linear_squares = std::exchange(squares, 0);
  on_each(Interpolation::cubic, add_error);
  const auto targets = static_cast<double>(hwy::SupportedAndGeneratedTargets().size());
  EXPECT_LT(std::sqrt(squares / targets / PlaceBatch::most), 0.005);  // waves 12 and 20 crossings long
  // A free gain makes up for most of what linear interpolation attenuates.
  if (!affine) {
    EXPECT_LT(squares, 0.5 * linear_squares);
  }
}

TEST_P(NearestPlace, NoiseOfTheCrossingsDoesNotDrawItToTheMiddle) {
  // Noise that the other camera's pixels share with nothing: the line between two of them has less of it.
  double with = 0, without = 0;
  constexpr int rounds = 60;
  for (unsigned round = 0; round < rounds; ++round) {
    std::mt19937 random(round);
    std::normal_distribution<double> noise(0, sigma);
    Sequences seen;
    for (int i = 0; i < 4; ++i) {
      for (int k = 0; k < frames; ++k) seen(k, i) = 0.1 * pattern(i)[k] + noise(random) / 3;
      seen.col(i).array() -= seen.col(i).mean();
    }
    for (unsigned k = 0; k < PlaceBatch::most; ++k)
      load(0.1 * seen_from(1 + 0.2 * (k / 15.0)), seen, round % 2, k, batch);
    find_nearest_places(batch, GetParam(), Interpolation::linear);
    for (unsigned k = 0; k < PlaceBatch::most; ++k) (round % 2 ? without : with) += batch.share[k] - 0.2 * (k / 15.0);
  }
  EXPECT_LT(std::abs(without), std::abs(with));
}

TEST_P(NearestPlace, KnowsNothingBesideAMissingCrossing) {
  for (unsigned k = 0; k < PlaceBatch::most; ++k) load(noisy(1.4, k), s, 0, k, batch);
  batch.usable[1][2] = batch.usable[2][3] = batch.usable[0][4] = batch.usable[3][5] = 0;
  on_each(Interpolation::cubic, [&](std::size_t k) {
    EXPECT_EQ(std::isnan(batch.share[k]), k == 2 || k == 3) << k;
    EXPECT_EQ(batch.is_cubic[k] > 0, k < 2 || k > 5) << k;
    EXPECT_EQ(batch.doubt[k] > 0, k < 2 || k > 5) << k;
  });
}

INSTANTIATE_TEST_SUITE_P(Normalisations, NearestPlace, testing::Values(Normalisation::none, Normalisation::affine),
                         [](const auto& test) { return std::string(name_of(test.param)); });

}  // namespace
}  // namespace pagesweep
