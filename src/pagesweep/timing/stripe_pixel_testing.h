// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "pagesweep/data/frames.h"

/// Gray value sequences of single pixels with known times, and the Cramer-Rao bound, for the tests and benchmarks of
/// timing/. Independent of what they test: shapes are formulas, derivatives are differences.
namespace pagesweep::testing {

/// The stripe's light over time, height about 1; time 0 is where the formula has it, not its centre.
using Shape = std::function<double(double time_frames)>;

inline Shape gaussian(double sigma) {
  return [=](double t) { return std::exp(-0.5 * t * t / (sigma * sigma)); };
}
/// A slit of `length` frames seen with a blur of `sigma` frames.
inline Shape flat_topped(double length, double sigma) {
  const double scale = sigma * std::numbers::sqrt2;
  const double height = std::erf(0.5 * length / scale);
  return [=](double t) {
    return 0.5 * (std::erf((t + 0.5 * length) / scale) - std::erf((t - 0.5 * length) / scale)) / height;
  };
}
/// Rises with `rise` and falls with `fall` frames of standard deviation.
inline Shape skewed(double rise, double fall) {
  return [=](double t) {
    // The width changes smoothly from one side to the other, so that the shape has all derivatives.
    const double sigma = rise + (fall - rise) / (1 + std::exp(-2 * t / rise));
    return std::exp(-0.5 * t * t / (sigma * sigma));
  };
}

/// A linear camera as in EMVA 1288.
struct Sensor {
  double gain = 0.02;       ///< gray values an electron
  double read_noise = 1.0;  ///< [gray values]
  double black_level = 4;   ///< [gray values]
  double saturation = 255;  ///< [gray values] first clipped one
  int bit_depth = 8;
  std::vector<double> exposures = {1};  ///< of the frames in turn: factors of the light
  double exposure(int i) const { return exposures[static_cast<std::size_t>(i) % exposures.size()]; }
  double variance(double light) const { return read_noise * read_noise + 1.0 / 12 + gain * std::max(light, 0.0); }
};

struct Pixel {
  double amplitude = 180;  ///< [gray values]
  double background = 3;   ///< [gray values] ambient light
  double time = 40;        ///< [frames]
  double width = 1;        ///< stretches the shape
};

/// Random numbers that depend on nothing but (seed, i): a counter run through the splitmix64 mixer, then Box-Muller.
inline double uniform(std::uint64_t seed, std::uint64_t i) {
  std::uint64_t z = (seed * 0x9E3779B97F4A7C15ULL) ^ ((i + 1) * 0xD1B54A32D192ED03ULL);
  for (int round = 0; round < 2; ++round) {
    z += 0x9E3779B97F4A7C15ULL;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
    z ^= z >> 31;
  }
  return (static_cast<double>(z >> 11) + 0.5) * 0x1p-53;
}
inline double normal(std::uint64_t seed, std::uint64_t i) {
  return std::sqrt(-2 * std::log(uniform(seed, 2 * i))) * std::cos(2 * std::numbers::pi * uniform(seed, 2 * i + 1));
}

/// Light at frame i, before the sensor.
inline double light(const Shape& shape, const Pixel& pixel, double i) {
  return pixel.amplitude * shape((i - pixel.time) / pixel.width) + pixel.background;
}
/// What the sensor makes of it: a whole gray value, black level included.
inline double expose(double light_value, const Sensor& sensor, std::uint64_t seed, std::uint64_t i) {
  const double noise = std::sqrt(sensor.read_noise * sensor.read_noise + sensor.gain * std::max(light_value, 0.0));
  const double gray = std::floor(light_value + sensor.black_level + noise * normal(seed, i) + 0.5);
  return std::min(std::max(gray, 0.0), std::pow(2.0, sensor.bit_depth) - 1);
}
/// A gray value sequence as Frames::read_row() gives it.
inline std::vector<float> expose(const Shape& shape, const Pixel& pixel, const Sensor& sensor, int count,
                                 std::uint64_t seed) {
  std::vector<float> samples;
  for (int i = 0; i < count; ++i) {
    const double gray = expose(light(shape, pixel, i), sensor, seed, static_cast<std::uint64_t>(i));
    samples.push_back(gray >= sensor.saturation ? std::numeric_limits<float>::infinity()
                                                : static_cast<float>(gray - sensor.black_level));
  }
  return samples;
}

/// Smallest standard deviation [frames] that an unbiased estimate of the pixel's time can have when amplitude and
/// background are unknown and the clipped samples and dropped frames are left out, whatever the frames' exposures.
inline double cramer_rao_bound(const Shape& shape, const Pixel& pixel, const Sensor& sensor, int count,
                               const std::vector<int>& dropped = {}) {
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  constexpr double h = 1e-4;
  for (int i = 0; i < count; ++i) {
    if (std::find(dropped.begin(), dropped.end(), i) != dropped.end()) continue;
    const double t = (i - pixel.time) / pixel.width;
    const double exposure = sensor.exposure(i), value = exposure * light(shape, pixel, i);
    if (value + sensor.black_level >= sensor.saturation - 0.5) continue;
    const double slope = (shape(t + h) - shape(t - h)) / (2 * h);
    const Eigen::Vector3d row = exposure * Eigen::Vector3d(shape(t), 1, -pixel.amplitude * slope / pixel.width);
    information += row * row.transpose() / sensor.variance(value);
  }
  return std::sqrt(information.inverse()(2, 2));
}

/// Frames of a camera, pixel (x, y) of which sees light_at(x, y, i) at frame i.
inline Frames make_frames(int width, int height, int count, const Sensor& sensor,
                          const std::function<double(int x, int y, int i)>& light_at, std::uint64_t seed = 1,
                          const std::vector<int>& dropped = {}) {
  Sequence sequence{"cam",
                    width,
                    height,
                    count,
                    sensor.bit_depth,
                    sensor.black_level,
                    sensor.saturation,
                    relative_exposures(sensor.exposures, count)};
  Frames frames(sequence);
  std::vector<Image<std::uint16_t>> images(static_cast<std::size_t>(count), Image<std::uint16_t>(width, height));
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const auto pixel_seed = seed * 1000003 + static_cast<std::uint64_t>(y * width + x);
      for (int i = 0; i < count; ++i)
        images[static_cast<std::size_t>(i)](x, y) = static_cast<std::uint16_t>(
            expose(sensor.exposure(i) * light_at(x, y, i), sensor, pixel_seed, static_cast<std::uint64_t>(i)));
    }
  for (int i = 0; i < count; ++i) {
    if (std::find(dropped.begin(), dropped.end(), i) != dropped.end()) continue;
    auto& image = images[static_cast<std::size_t>(i)];
    if (sequence.is_8_bit()) {
      Image<std::uint8_t> narrow(width, height);
      std::ranges::transform(image.pixels(), narrow.data(), [](int gray) { return static_cast<std::uint8_t>(gray); });
      frames.set(i, std::move(narrow));
    } else {
      frames.set(i, std::move(image));
    }
  }
  return frames;
}

/// Frames of a camera whose pixel (x, y) sees the stripe as pixel_at(x, y) says.
inline Frames make_frames(int width, int height, int count, const Shape& shape, const Sensor& sensor,
                          const std::function<Pixel(int x, int y)>& pixel_at, std::uint64_t seed = 1,
                          const std::vector<int>& dropped = {}) {
  return make_frames(
      width, height, count, sensor, [&](int x, int y, int i) { return light(shape, pixel_at(x, y), i); }, seed,
      dropped);
}

}  // namespace pagesweep::testing
