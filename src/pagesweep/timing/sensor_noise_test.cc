// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/timing/sensor_noise.h"

#include <gtest/gtest.h>

#include <vector>

#include "pagesweep/timing/stripe_pixel_testing.h"

namespace pagesweep {
namespace {

std::vector<NoiseSample> residuals(double read_variance, double gain, double outlier_share) {
  std::vector<NoiseSample> samples;
  for (std::uint64_t i = 0; i < 40000; ++i) {
    const double gray = 200 * testing::uniform(1, i) * testing::uniform(2, i);
    double residual = std::sqrt(read_variance + gain * gray) * testing::normal(3, i);
    if (testing::uniform(4, i) < outlier_share) residual += 30;
    samples.push_back({gray, residual * residual});
  }
  return samples;
}

TEST(FitSensorNoise, RecoversReadNoiseAndGain) {
  const SensorNoise noise = fit_sensor_noise(residuals(1.5, 0.03, 0));
  EXPECT_NEAR(noise.read_variance, 1.5, 0.06);  // 1 % each from 40000 samples, and they lean on each other
  EXPECT_NEAR(noise.gain, 0.03, 0.0015);
}

TEST(FitSensorNoise, IsNotMovedByThreePercentOfOutliers) {
  const SensorNoise noise = fit_sensor_noise(residuals(1.5, 0.03, 0.03));
  EXPECT_NEAR(noise.read_variance, 1.5, 0.1);
  EXPECT_NEAR(noise.gain, 0.03, 0.003);
}

TEST(FitSensorNoise, KnowsTheFloorOfQuantisation) {
  const SensorNoise noise = fit_sensor_noise(residuals(0.001, 0.02, 0));
  EXPECT_GE(noise.read_variance, 1.0 / 12);
  EXPECT_NEAR(noise.gain, 0.02, 0.006);  // what the floor adds in the dark is missing in the slope
}

TEST(FitSensorNoise, LeavesTheDefaultWhereNothingIsKnown) {
  EXPECT_EQ(fit_sensor_noise({}).read_variance, SensorNoise().read_variance);
}

}  // namespace
}  // namespace pagesweep
