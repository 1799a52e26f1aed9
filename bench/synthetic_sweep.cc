// SPDX-License-Identifier: Apache-2.0
#include "bench/synthetic_sweep.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "pagesweep/base/parallel.h"
#include "pagesweep/sim/analytic_scene.h"
#include "pagesweep/timing/stripe_pixel_testing.h"

namespace pagesweep::bench {
namespace {

constexpr int full_side_px = 1024;
constexpr double begin_mm = -170, end_mm = 170;  ///< of the sweep, along y
constexpr double ambient = 3;                    ///< [gray values]
constexpr double reach_sigmas = 5;               ///< beyond it the bell is less than a thousandth of a gray value
const testing::Sensor sensor{.gain = 0.02, .read_noise = 1.2};

double amplitude_at(int x, int y) { return 140 + 80 * std::sin(0.05 * x) * std::cos(0.037 * y); }

/// Normally distributed numbers that cost a look into a table each.
class Noise {
 public:
  explicit Noise(std::uint64_t seed) : seed_(seed) {}
  float operator()(std::uint64_t pixel, int frame) const {
    std::uint64_t z = seed_ + pixel * 0x9E3779B97F4A7C15ULL + static_cast<std::uint64_t>(frame) * 0xD1B54A32D192ED03ULL;
    z = (z ^ (z >> 32)) * 0xBF58476D1CE4E5B9ULL;
    return table()[z >> 48];
  }

 private:
  static const std::vector<float>& table() {
    static const std::vector<float> values = [] {
      std::vector<float> normal;
      for (std::uint64_t i = 0; i < 1 << 16; ++i) normal.push_back(static_cast<float>(testing::normal(7, i)));
      return normal;
    }();
    return values;
  }
  std::uint64_t seed_;
};

/// What the sensor makes of light, as in testing::expose().
std::uint8_t exposed(double light, float noise) {
  const double sigma = std::sqrt(sensor.read_noise * sensor.read_noise + sensor.gain * light);
  const double gray = std::floor(light + sensor.black_level + sigma * static_cast<double>(noise) + 0.5);
  return static_cast<std::uint8_t>(std::clamp(gray, 0.0, 255.0));
}

Frames make_frames(const Camera& camera, std::vector<Image<std::uint8_t>> images) {
  Frames frames({camera.name, camera.width, camera.height, static_cast<int>(images.size()), sensor.bit_depth,
                 sensor.black_level, sensor.saturation});
  for (std::size_t i = 0; i < images.size(); ++i) frames.set(static_cast<int>(i), std::move(images[i]));
  return frames;
}

Frames expose_stripe(const TimeMap& passing, const Camera& camera, const Sweep& sweep, std::uint64_t seed) {
  std::vector<Image<std::uint8_t>> images(static_cast<std::size_t>(sweep.frames()),
                                          Image<std::uint8_t>(camera.width, camera.height));
  const Noise noise(seed);
  const double sigma = sweep.sigma_frames();
  parallel_rows(camera.height, [&](int y) {
    for (int i = 0; i < sweep.frames(); ++i) {
      const auto out = images[static_cast<std::size_t>(i)].row(y);
      for (int x = 0; x < camera.width; ++x) {
        const double t = (i - static_cast<double>(passing.time(x, y))) / sigma;
        double light = ambient;
        if (std::abs(t) < reach_sigmas) light += static_cast<double>(passing.amplitude(x, y)) * std::exp(-0.5 * t * t);
        const auto pixel =
            static_cast<std::uint64_t>(y) * static_cast<std::uint64_t>(camera.width) + static_cast<std::uint64_t>(x);
        out[static_cast<std::size_t>(x)] = exposed(light, noise(pixel, i));
      }
    }
  });
  return make_frames(camera, std::move(images));
}

/// Gives its frames away, so that reading costs nothing.
class MemorySource : public FrameSource {
 public:
  explicit MemorySource(const std::vector<Frames>& cameras) {
    for (const Frames& camera : cameras) sequences_.push_back(camera.sequence());
    for (int i = 0; i < sequences_.front().count; ++i) {
      FrameSet& set = sets_.emplace_back(FrameSet{i, {}});
      for (const Frames& camera : cameras)
        set.images.push_back(camera.has(i) ? std::optional(camera.frame(i)) : std::nullopt);
    }
  }
  const std::vector<Sequence>& sequences() const override { return sequences_; }
  std::optional<FrameSet> next() override {
    if (next_ == sets_.size()) return std::nullopt;
    return std::move(sets_[next_++]);
  }

 private:
  std::vector<Sequence> sequences_;
  std::vector<FrameSet> sets_;
  std::size_t next_ = 0;
};

}  // namespace

SyntheticScene make_scene(int side_px) {
  SyntheticScene scene;
  scene.rig = sim::make_test_rig(full_side_px);
  const sim::AnalyticScene page{
      [](double x, double y) { return 20 + 0.08 * x + 15 * std::cos(x / 60) + 6 * std::sin(y / 50); }, 70, -20};
  for (Camera& camera : scene.rig.cameras) {
    camera.fx = camera.fy = 2 * full_side_px;  // longer than the test rig's: the stripe passes every pixel
    camera.cx = camera.cy = 0.5 * (side_px - 1);
    camera.width = camera.height = side_px;
    scene.points.push_back(page.points(camera));
  }
  return scene;
}

std::vector<RayTable> rays_of(const SyntheticScene& scene) {
  return {scene.rig.cameras.begin(), scene.rig.cameras.end()};
}

SyntheticFrames sweep_over(const SyntheticScene& scene, const Sweep& sweep) {
  SyntheticFrames made{
      Light(TranslatingPlane{Eigen::Vector3d::UnitY(), begin_mm, (end_mm - begin_mm) / sweep.count}), {}, {}};
  for (std::size_t c = 0; c < scene.points.size(); ++c) {
    const Camera& camera = scene.rig.cameras[c];
    const PointMap& points = scene.points[c];
    TimeMap& times = made.truth.emplace_back(camera.width, camera.height);
    parallel_rows(camera.height, [&](int y) {
      for (int x = 0; x < camera.width; ++x) {
        if (points.status(x, y) != PixelStatus::ok) continue;
        const auto time = made.light.time_of({points.x(x, y), points.y(x, y), points.z(x, y)});
        times.time(x, y) = static_cast<float>(*time);
        times.amplitude(x, y) = static_cast<float>(amplitude_at(x, y));
        times.status(x, y) = PixelStatus::ok;
      }
    });
    made.frames.push_back(expose_stripe(times, camera, sweep, c + 1));
  }
  return made;
}

std::vector<Frames> project_waves(const SyntheticScene& scene, int count) {
  std::vector<Frames> frames;
  for (std::size_t c = 0; c < scene.points.size(); ++c) {
    const Camera& camera = scene.rig.cameras[c];
    const PointMap& points = scene.points[c];
    const Noise noise(c + 11);
    std::vector<Image<std::uint8_t>> images;
    for (int i = 0; i < count; ++i) {
      const auto uniform = [&](std::uint64_t k) { return testing::uniform(99, 3 * static_cast<std::uint64_t>(i) + k); };
      const double angle = 2 * std::numbers::pi * uniform(0), phase = 2 * std::numbers::pi * uniform(1);
      const double per_mm = 2 * std::numbers::pi / (5 + 20 * uniform(2));
      Image<std::uint8_t>& image = images.emplace_back(camera.width, camera.height);
      parallel_rows(camera.height, [&](int y) {
        for (int x = 0; x < camera.width; ++x) {
          const double along = static_cast<double>(points.x(x, y)) * std::cos(angle) +
                               static_cast<double>(points.y(x, y)) * std::sin(angle);
          const bool is_seen = points.status(x, y) == PixelStatus::ok;
          const auto pixel =
              static_cast<std::uint64_t>(y) * static_cast<std::uint64_t>(camera.width) + static_cast<std::uint64_t>(x);
          image(x, y) = exposed(is_seen ? 90 + 80 * std::sin(per_mm * along + phase) : 0, noise(pixel, i));
        }
      });
    }
    frames.push_back(make_frames(camera, std::move(images)));
  }
  return frames;
}

double error_over_bound(const SyntheticFrames& sweep, const Sweep& settings, const std::vector<TimeMap>& measured) {
  const auto shape = testing::gaussian(settings.sigma_frames());
  std::vector<double> errors;
  double bound_squares = 0;
  for (std::size_t c = 0; c < measured.size(); ++c)
    for (std::size_t k = 0; k < measured[c].time.size(); k += 61) {
      const double time = static_cast<double>(sweep.truth[c].time.data()[k]);
      if (measured[c].status.data()[k] != PixelStatus::ok || !std::isfinite(time)) continue;
      const testing::Pixel pixel{static_cast<double>(sweep.truth[c].amplitude.data()[k]), ambient, time};
      bound_squares += std::pow(testing::cramer_rao_bound(shape, pixel, sensor, settings.frames()), 2);
      errors.push_back(static_cast<double>(measured[c].time.data()[k]) - time);
    }
  const auto count = static_cast<double>(errors.size());
  double mean = 0, squares = 0;
  for (const double error : errors) mean += error / count;
  for (const double error : errors) squares += (error - mean) * (error - mean);
  return std::sqrt(squares / bound_squares);
}

double rms_error_mm(const PointMap& points, const PointMap& truth) {
  double squares = 0, count = 0;
  for (std::size_t k = 0; k < points.status.size(); ++k) {
    if (points.status.data()[k] != PixelStatus::ok || truth.status.data()[k] != PixelStatus::ok) continue;
    const Eigen::Vector3d difference(points.x.data()[k] - truth.x.data()[k], points.y.data()[k] - truth.y.data()[k],
                                     points.z.data()[k] - truth.z.data()[k]);
    squares += difference.squaredNorm();
    ++count;
  }
  return std::sqrt(squares / count);
}

std::unique_ptr<FrameSource> source_of(const std::vector<Frames>& frames) {
  return std::make_unique<MemorySource>(frames);
}

}  // namespace pagesweep::bench
