// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/matching/nearest_place.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace pagesweep {
namespace {

constexpr int frames = 12;
using Sequence = Eigen::Matrix<double, frames, 1>;
using Sequences = Eigen::Matrix<double, frames, SequenceProducts::crossings>;

/// Waves that travel with the place, without mean.
Sequence pattern(double place) {
  Sequence s;
  for (int i = 0; i < frames; ++i)
    s[i] = 100 * std::sin(0.5 * place + 2.4 * i) + 60 * std::sin(0.3 * place - 1.1 * i * i);
  return s.array() - s.mean();
}

SequenceProducts products_of(const Sequence& g, const Sequences& s) {
  SequenceProducts p;
  p.gg = g.squaredNorm();
  p.gs = s.transpose() * g;
  p.ss = s.transpose() * s;
  p.usable.fill(true);
  return p;
}

Sequences crossings() {
  Sequences s;
  for (int i = 0; i < SequenceProducts::crossings; ++i) s.col(i) = pattern(i);
  return s;
}

double distance_squared(const Sequence& g, const Sequence& s, bool affine) {
  const double gain = affine ? std::max(0.0, g.dot(s) / s.squaredNorm()) : 1;
  return (g - gain * s).squaredNorm();
}

class NearestPlace : public testing::TestWithParam<Normalisation> {
 protected:
  const bool affine = GetParam() == Normalisation::affine;
  const Sequences s = crossings();
  Sequence noisy(double place, unsigned seed) const {
    std::mt19937 random(seed);
    std::normal_distribution<double> noise(0, 5);
    Sequence g = (affine ? 1.3 : 1.0) * pattern(place);
    for (int i = 0; i < frames; ++i) g[i] += noise(random);
    return g.array() - g.mean();
  }
};

TEST_P(NearestPlace, IsTheBestOfAllOnThePolyline) {
  for (unsigned seed = 0; seed < 50; ++seed) {
    const Sequence g = noisy(1.05 + 0.06 * seed, seed);
    const CurvePlace place = nearest_on_polyline(products_of(g, s), GetParam());
    double least = std::numeric_limits<double>::infinity();
    for (int i = 1; i <= 3; ++i)
      for (double share = 0; share <= 1; share += 1e-3)
        least = std::min(least, distance_squared(g, (1 - share) * s.col(i) + share * s.col(i + 1), affine));
    EXPECT_LE(place.distance_squared, least * (1 + 1e-9));
    EXPECT_NEAR(place.distance_squared, least, 1e-2 * least);
    EXPECT_NEAR(distance_squared(g, s.middleCols<4>(place.segment - 1) * place.value, affine), place.distance_squared,
                1e-6 * place.distance_squared);
  }
}

TEST_P(NearestPlace, FindsThePlaceOfASmoothPattern) {
  double linear_squares = 0, cubic_squares = 0;
  for (unsigned i = 0; i < 60; ++i) {
    const double truth = 1.02 + 0.05 * i;
    const Sequence g = (affine ? 1.3 : 1.0) * pattern(truth);
    const auto error = [&](Interpolation interpolation) {
      const SequenceProducts p = products_of(g, s);
      const CurvePlace place = nearest_place(p, nearest_on_polyline(p, GetParam()), GetParam(), interpolation);
      return place.segment + place.share - truth;
    };
    linear_squares += std::pow(error(Interpolation::linear), 2);
    cubic_squares += std::pow(error(Interpolation::cubic), 2);
  }
  EXPECT_LT(std::sqrt(cubic_squares / 60), 0.005);  // waves 12 and 20 crossings long
  // A free gain makes up for most of what linear interpolation attenuates.
  if (!affine) {
    EXPECT_LT(cubic_squares, 0.5 * linear_squares);
  }
}

TEST_P(NearestPlace, PassesOverCrossingsThatAreMissing) {
  SequenceProducts p = products_of(noisy(2.4, 1), s);
  p.usable[2] = false;
  const CurvePlace place = nearest_on_polyline(p, GetParam());
  EXPECT_TRUE(place.segment == 3);
  p.usable.fill(false);
  EXPECT_EQ(nearest_on_polyline(p, GetParam()).segment, -1);
}

INSTANTIATE_TEST_SUITE_P(Normalisations, NearestPlace, testing::Values(Normalisation::none, Normalisation::affine),
                         [](const auto& test) { return std::string(name_of(test.param)); });

}  // namespace
}  // namespace pagesweep
