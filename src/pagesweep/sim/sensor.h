// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "pagesweep/sim/random.h"

namespace pagesweep::sim {

/// A sensor after EMVA 1288: light becomes electrons with shot noise, read noise is added, the sum is amplified,
/// quantised and clipped.
struct SensorModel {
  int bit_depth = 8;                   ///< 8 to 16
  double full_well_electrons = 10000;  ///< they make the highest gray value
  double read_noise_electrons = 15;    ///< one standard deviation
  double black_level = 2;              ///< [gray values] without light
  bool noisy = true;                   ///< false: quantised and clipped only

  double highest() const { return static_cast<double>((1 << bit_depth) - 1); }  ///< [gray values]
  /// [electrons per gray value]
  double gain() const { return full_well_electrons / (highest() - black_level); }
};

/// One sample of a pixel.
/// \param light    1 fills the full well
/// \param address  of the sample in the noise: unique for each (frame, pixel)
/// \return         gray value
std::uint16_t expose(const SensorModel& sensor, double light, const CounterRandom& noise, std::uint64_t address);

}  // namespace pagesweep::sim
