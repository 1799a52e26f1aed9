// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/sim/render_camera.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <type_traits>

#include "pagesweep/base/parallel.h"
#include "pagesweep/data/time_map.h"

namespace pagesweep::sim {
namespace {

/// Integral of the standard normal distribution's cumulative function.
double cumulated_twice(double z) {
  const double cumulative = 0.5 * std::erfc(-z * std::numbers::sqrt2 / 2);
  return z * cumulative + std::exp(-0.5 * z * z) / std::sqrt(2 * std::numbers::pi);
}

constexpr int taps_per_side = 3;

/// One ray of a pixel's bundle, which stands for a part of the spot that the pixel sees. The print is finer than the
/// rays, so it is looked up at several taps of each part, whose places follow from the ray's own.
struct SpotSample {
  Eigen::Vector2d offset_px;
  std::array<Eigen::Vector2f, taps_per_side * taps_per_side> taps_px;  ///< relative to offset_px
};

std::vector<SpotSample> spot_samples(int per_side, double psf_sigma_px) {
  const std::vector<double> offsets = spot_offsets(taps_per_side * per_side, psf_sigma_px);
  const auto offset = [&](int part, int tap) { return offsets[std::size_t(taps_per_side * part + tap)]; };
  const int middle = taps_per_side / 2;
  std::vector<SpotSample> samples;
  for (int j = 0; j < per_side; ++j)
    for (int i = 0; i < per_side; ++i) {
      SpotSample& sample = samples.emplace_back();
      sample.offset_px = {offset(i, middle), offset(j, middle)};
      for (int tap = 0; tap < taps_per_side * taps_per_side; ++tap) {
        const Eigen::Vector2d place(offset(i, tap % taps_per_side), offset(j, tap / taps_per_side));
        sample.taps_px[std::size_t(tap)] = (place - sample.offset_px).cast<float>();
      }
    }
  return samples;
}

/// How paper coordinates and the stripe's time change across a pixel. Zero where it sees more than one surface.
struct PixelSlopes {
  Eigen::Matrix2f st_by_px = Eigen::Matrix2f::Zero();
  Eigen::RowVector2f time_by_px = Eigen::RowVector2f::Zero();
};

/// Light of one surface within a pixel that is the same for all of the spot: it arrives from everywhere.
struct SurfaceShare {
  int surface = -1;
  float albedo = 0, s = 0, t = 0, rays = 0;  ///< sums over the rays that hit the surface
};

class CameraRenderer {
 public:
  CameraRenderer(const LitWorld& lit, const Camera& camera, int viewer, const CameraOptions& options)
      : lit_(lit),
        camera_(camera),
        viewer_(viewer),
        options_(options),
        rig_from_cam_(camera.cam_from_rig.inverse()),
        samples_(spot_samples(options.rays_per_side, options.psf_sigma_px)) {
    const double mm_per_px = rig_from_cam_.translation.z() / camera.fx;
    const double spot_px = std::sqrt(1.0 / 12 + options.psf_sigma_px * options.psf_sigma_px);
    const double tap_spacing_mm = 2.5 * spot_px * mm_per_px / (taps_per_side * options.rays_per_side);
    for (const Surface& surface : lit.world.surfaces) levels_.push_back(surface.albedo.level_for(tap_spacing_mm));
  }

  struct Scratch {
    std::vector<SimRay> rays;
    std::vector<SimHit> hits;
  };

  /// Light on a pixel at each frame; 1 fills the full well.
  void expose_pixel(int x, int y, Scratch& scratch, std::span<float> frames) const {
    std::ranges::fill(frames, 0.0f);
    if (!aim(x, y, scratch.rays)) return;
    scratch.hits.resize(scratch.rays.size());
    lit_.caster.cast(scratch.rays, scratch.hits);
    const PixelSlopes slopes = slopes_of(scratch.hits);
    std::array<SurfaceShare, 4> shares;  // a pixel that shows more surfaces than this loses the glow on the rest
    const float share_of_ray = static_cast<float>(options_.exposure) / static_cast<float>(samples_.size());
    for (std::size_t k = 0; k < samples_.size(); ++k) {
      const SimHit& hit = scratch.hits[k];
      if (hit.surface < 0) continue;
      const auto number = static_cast<std::size_t>(hit.surface);
      NodeLight light = light_at(lit_.direct[number], hit.spot);
      const Eigen::Vector2f st = lit_.world.surfaces[number].mesh.parameters(hit.spot);
      const float gloss = light.gloss[viewer_];
      if (gloss > 0) add_stripe(lit_.stripe, light, share_of_ray * gloss, frames);
      const Print print = look_up(number, st, samples_[k], slopes);
      light.time += print.later;
      add_stripe(lit_.stripe, light, share_of_ray * print.albedo * light.diffuse, frames);
      collect(hit.surface, print.albedo, st, shares);
    }
    for (const SurfaceShare& share : shares) {
      if (share.rays == 0) continue;
      const float weight = share_of_ray * share.albedo;
      lit_.bounce.add(share.surface, share.s / share.rays, share.t / share.rays, weight, frames);
      for (float& frame : frames) frame += weight * static_cast<float>(options_.ambient);
    }
  }

 private:
  /// The bundle of rays of a pixel. Within its few pixels the distortion is linear to 1e-4 px.
  bool aim(int x, int y, std::vector<SimRay>& rays) const {
    const Eigen::Vector2d image((x - camera_.cx) / camera_.fx, (y - camera_.cy) / camera_.fy);
    const auto ideal = camera_.distortion.undistort(image);
    if (!ideal) return false;
    const Eigen::Matrix2d ideal_by_image = camera_.distortion.jacobian(*ideal).inverse();
    rays.clear();
    for (const SpotSample& sample : samples_) {
      const Eigen::Vector2d offset(sample.offset_px.x() / camera_.fx, sample.offset_px.y() / camera_.fy);
      const Eigen::Vector2d direction = *ideal + ideal_by_image * offset;
      rays.push_back({rig_from_cam_.translation.cast<float>(),
                      (rig_from_cam_.rotation * Eigen::Vector3d(direction.x(), direction.y(), 1)).cast<float>()});
    }
    return true;
  }

  /// From the rays beside the middle one.
  PixelSlopes slopes_of(std::span<const SimHit> hits) const {
    const int side = options_.rays_per_side;
    const int low = std::max(side / 2 - 1, 0), high = std::min(side / 2 + 1, side - 1);
    const auto number = [&](int i, int j) { return static_cast<std::size_t>(j * side + i); };
    const std::array<std::size_t, 4> ends{number(low, side / 2), number(high, side / 2), number(side / 2, low),
                                          number(side / 2, high)};
    PixelSlopes slopes;
    const int surface = hits[ends[0]].surface;
    const bool is_one = std::ranges::all_of(hits, [&](const SimHit& hit) { return hit.surface == surface; });
    if (surface < 0 || !is_one || low == high) return slopes;
    const GridMesh& mesh = lit_.world.surfaces[std::size_t(surface)].mesh;
    for (int axis : {0, 1}) {
      const std::size_t from = ends[std::size_t(2 * axis)], to = ends[std::size_t(2 * axis + 1)];
      const auto span = static_cast<float>(samples_[to].offset_px[axis] - samples_[from].offset_px[axis]);
      slopes.st_by_px.col(axis) = (mesh.parameters(hits[to].spot) - mesh.parameters(hits[from].spot)) / span;
      const auto& nodes = lit_.direct[std::size_t(surface)];
      slopes.time_by_px[axis] = (light_at(nodes, hits[to].spot).time - light_at(nodes, hits[from].spot).time) / span;
    }
    return slopes;
  }

  /// What one part of the spot shows: its mean albedo, and how much later [frames] than its ray's the stripe passes the
  /// centre of what is bright in it.
  struct Print {
    float albedo = 0, later = 0;
  };
  Print look_up(std::size_t surface, const Eigen::Vector2f& st, const SpotSample& sample,
                const PixelSlopes& slopes) const {
    const Texture& texture = lit_.world.surfaces[surface].albedo;
    if (texture.is_constant()) return {texture.at(0, 0, 0), 0};
    float albedo = 0, later = 0;
    for (const Eigen::Vector2f& tap : sample.taps_px) {
      const Eigen::Vector2f place = st + slopes.st_by_px * tap;
      const float here = texture.at(place.x(), place.y(), levels_[surface]);
      albedo += here;
      later += here * slopes.time_by_px.dot(tap);
    }
    return {albedo / static_cast<float>(sample.taps_px.size()), albedo > 0 ? later / albedo : 0};
  }

  static void collect(int surface, float albedo, const Eigen::Vector2f& st, std::span<SurfaceShare> shares) {
    for (SurfaceShare& share : shares) {
      if (share.surface != surface && share.rays > 0) continue;
      share.surface = surface;
      share.albedo += albedo;
      share.s += st.x();
      share.t += st.y();
      share.rays += 1;
      return;
    }
  }

  const LitWorld& lit_;
  const Camera& camera_;
  int viewer_;
  const CameraOptions& options_;
  Rigid3 rig_from_cam_;
  std::vector<SpotSample> samples_;
  std::vector<int> levels_;  ///< of the texture, by surface
};

template <class Pixel>
std::vector<Image<Pixel>> render(const CameraRenderer& renderer, const Camera& camera, const SensorModel& sensor,
                                 const CameraOptions& options, const CounterRandom& noise, Progress& progress) {
  const int frames = options.frames;
  const auto exposure = [&](int i) {
    return options.exposures.empty() ? 1 : options.exposures[std::size_t(i) % options.exposures.size()];
  };
  std::vector<Image<Pixel>> images;
  for (int i = 0; i < frames; ++i) images.emplace_back(camera.width, camera.height);
  const int band = 32;  // rows between two reports of progress
  for (int begin = 0; begin < camera.height; begin += band) {
    parallel_rows(std::min(band, camera.height - begin), [&](int row) {
      const int y = begin + row;
      CameraRenderer::Scratch scratch;
      std::vector<float> light(static_cast<std::size_t>(frames));
      Image<Pixel> gray(camera.width, frames);
      for (int x = 0; x < camera.width; ++x) {
        renderer.expose_pixel(x, y, scratch, light);
        const auto first = (std::uint64_t(y) * std::uint64_t(camera.width) + std::uint64_t(x)) * std::uint64_t(frames);
        for (int i = 0; i < frames; ++i)
          gray(x, i) = static_cast<Pixel>(expose(sensor, exposure(i) * static_cast<double>(light[std::size_t(i)]),
                                                 noise, first + std::uint64_t(i)));
      }
      for (int i = 0; i < frames; ++i) std::ranges::copy(gray.row(i), images[std::size_t(i)].row(y).begin());
    });
    progress.advance(std::min(1.0, double(begin + band) / camera.height));
  }
  return images;
}

}  // namespace

std::vector<double> spot_offsets(int count, double psf_sigma_px) {
  const double sigma = std::max(psf_sigma_px, 1e-3);
  const auto cumulative = [&](double x) {
    return sigma * (cumulated_twice((x + 0.5) / sigma) - cumulated_twice((x - 0.5) / sigma));
  };
  std::vector<double> offsets;
  for (int k = 0; k < count; ++k) {
    double low = -0.5 - 8 * sigma, high = 0.5 + 8 * sigma;
    for (int i = 0; i < 60; ++i) {
      const double middle = 0.5 * (low + high);
      (cumulative(middle) < (k + 0.5) / count ? low : high) = middle;
    }
    offsets.push_back(0.5 * (low + high));
  }
  // The parts' own widths are missing in the variance of their medians.
  double variance = 0;
  for (const double offset : offsets) variance += offset * offset / count;
  const double stretch = count > 1 ? std::sqrt((1.0 / 12 + sigma * sigma) / variance) : 1;
  for (double& offset : offsets) offset *= stretch;
  return offsets;
}

Frames render_camera(const LitWorld& lit, const Camera& camera, int viewer, const CameraOptions& options,
                     const SensorModel& sensor, std::uint64_t seed, Progress& progress) {
  progress.begin("rendering " + camera.name);
  const CameraRenderer renderer(lit, camera, viewer, options);
  const CounterRandom noise(seed, static_cast<std::uint64_t>(viewer));
  Frames frames({camera.name, camera.width, camera.height, options.frames, sensor.bit_depth, sensor.black_level,
                 sensor.highest(), relative_exposures(options.exposures, options.frames)});
  const auto take = [&](auto images) {
    for (int i = 0; i < options.frames; ++i) frames.set(i, std::move(images[std::size_t(i)]));
  };
  if (sensor.bit_depth <= 8)
    take(render<std::uint8_t>(renderer, camera, sensor, options, noise, progress));
  else
    take(render<std::uint16_t>(renderer, camera, sensor, options, noise, progress));
  return frames;
}

Image<Eigen::Vector3f> find_camera_points(const World& world, const RayCaster& caster, const Camera& camera) {
  Image<Eigen::Vector3f> points(camera.width, camera.height, Eigen::Vector3f::Constant(not_a_number));
  parallel_rows(camera.height, [&](int y) {
    for (int x = 0; x < camera.width; ++x) {
      const auto ray = camera.ray({double(x), double(y)});
      if (!ray) continue;
      const SimHit hit = caster.cast({ray->origin.cast<float>(), ray->direction.cast<float>()});
      if (hit.surface < 0 || !world.surfaces[std::size_t(hit.surface)].is_measured) continue;
      points(x, y) = world.surfaces[std::size_t(hit.surface)].mesh.point(hit.spot).cast<float>();
    }
  });
  return points;
}

}  // namespace pagesweep::sim
