// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/sim/sensor.h"

#include <gtest/gtest.h>

#include <cmath>

namespace pagesweep::sim {
namespace {

TEST(Expose, GivesBlackLevelAndSaturation) {
  const CounterRandom noise(1, 1);
  for (const int bit_depth : {8, 10, 12, 16}) {
    SensorModel sensor;
    sensor.bit_depth = bit_depth;
    sensor.noisy = false;
    EXPECT_EQ(expose(sensor, 0, noise, 0), sensor.black_level);
    EXPECT_EQ(expose(sensor, 1, noise, 0), sensor.highest());
    EXPECT_EQ(expose(sensor, 50, noise, 0), sensor.highest());
  }
}

// Photon transfer: the variance grows with the mean by 1 / gain (EMVA 1288), from read noise and quantisation.
TEST(Expose, FollowsThePhotonTransferCurve) {
  SensorModel sensor;
  sensor.bit_depth = 12;
  const CounterRandom noise(5, 2);
  const int draws = 200000;
  for (const double light : {0.02, 0.3, 0.8}) {
    double sum = 0, squares = 0;
    for (int i = 0; i < draws; ++i) {
      const double gray = expose(sensor, light, noise, static_cast<std::uint64_t>(i));
      sum += gray;
      squares += gray * gray;
    }
    const double mean = sum / draws, variance = squares / draws - mean * mean;
    const double electrons = light * sensor.full_well_electrons;
    const double expected =
        (electrons + std::pow(sensor.read_noise_electrons, 2)) / std::pow(sensor.gain(), 2) + 1.0 / 12;
    EXPECT_NEAR(mean, electrons / sensor.gain() + sensor.black_level, 4 * std::sqrt(expected / draws)) << light;
    EXPECT_NEAR(variance / expected, 1, 0.02) << light;
  }
}

}  // namespace
}  // namespace pagesweep::sim
