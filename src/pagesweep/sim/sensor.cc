// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/sim/sensor.h"

#include <algorithm>
#include <cmath>

namespace pagesweep::sim {

std::uint16_t expose(const SensorModel& sensor, double light, const CounterRandom& noise, std::uint64_t address) {
  double electrons = light * sensor.full_well_electrons;
  if (sensor.noisy) {
    electrons = poisson(electrons, noise.uniform(2 * address)) +
                sensor.read_noise_electrons * fast_inverse_normal(noise.uniform(2 * address + 1));
  }
  const double gray = electrons / sensor.gain() + sensor.black_level;
  return static_cast<std::uint16_t>(std::clamp(std::floor(gray + 0.5), 0.0, sensor.highest()));
}

}  // namespace pagesweep::sim
