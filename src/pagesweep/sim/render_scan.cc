// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/sim/render_scan.h"

#include <algorithm>
#include <cmath>

#include "pagesweep/base/parallel.h"
#include "pagesweep/io/color_profile.h"
#include "pagesweep/sim/random.h"

namespace pagesweep::sim {
namespace {

/// Viewing rays at the corners of a row's pixels; inside a pixel they are interpolated, exact to 1e-6 px.
using Corners = std::vector<std::optional<Ray>>;

Corners rays_along(const Scanner& scanner, double row) {
  Corners corners;
  for (int x = 0; x <= scanner.width(); ++x) corners.push_back(scanner.ray({x - 0.5, row}));
  return corners;
}

SimRay between(const Ray& top_left, const Ray& top_right, const Ray& low_left, const Ray& low_right, double a,
               double b) {
  const auto mix = [&](const auto& member) -> Eigen::Vector3d {
    return (1 - b) * ((1 - a) * member(top_left) + a * member(top_right)) +
           b * ((1 - a) * member(low_left) + a * member(low_right));
  };
  return {mix([](const Ray& ray) { return ray.origin; }).cast<float>(),
          mix([](const Ray& ray) { return ray.direction; }).cast<float>()};
}

/// The bare table's light on a grid of spots, by which a scan is divided.
class WhiteReference {
 public:
  explicit WhiteReference(const Lamp& lamp) : light_(2 * reach / spacing + 1, 2 * reach / spacing + 1) {
    for (int j = 0; j < light_.height(); ++j)
      for (int i = 0; i < light_.width(); ++i)
        light_(i, j) = float(open_irradiance(lamp, Eigen::Vector3d(i * spacing - reach, j * spacing - reach, 0)));
  }
  float at(float x_mm, float y_mm) const {
    const float x = std::clamp((x_mm + reach) / spacing, 0.0f, float(light_.width()) - 1.001f);
    const float y = std::clamp((y_mm + reach) / spacing, 0.0f, float(light_.height()) - 1.001f);
    const int i = static_cast<int>(x), j = static_cast<int>(y);
    const float a = x - float(i), b = y - float(j);
    return (1 - b) * ((1 - a) * light_(i, j) + a * light_(i + 1, j)) +
           b * ((1 - a) * light_(i, j + 1) + a * light_(i + 1, j + 1));
  }

 private:
  static constexpr int reach = 300, spacing = 20;  // [mm]
  Image<float> light_;
};

class ScanRenderer {
 public:
  ScanRenderer(const LitWorld& lit, const Lamp& lamp, const Scanner& scanner, const ScanOptions& options)
      : lit_(lit), white_(lamp), scanner_(scanner), options_(options) {}

  /// Reflected light of a row's pixels, evened out.
  std::vector<float> light_row(int y) const {
    const Corners top = rays_along(scanner_, y - 0.5), low = rays_along(scanner_, y + 0.5);
    const int side = options_.rays_per_side;
    std::vector<float> light(static_cast<std::size_t>(scanner_.width()));
    std::vector<SimRay> rays;
    std::vector<SimHit> hits(static_cast<std::size_t>(side * side));
    for (std::size_t x = 0; x < light.size(); ++x) {
      if (!top[x] || !top[x + 1] || !low[x] || !low[x + 1]) continue;
      rays.clear();
      for (int k = 0; k < side * side; ++k)
        rays.push_back(
            between(*top[x], *top[x + 1], *low[x], *low[x + 1], (k % side + 0.5) / side, (k / side + 0.5) / side));
      lit_.caster.cast(rays, hits);
      for (const SimHit& hit : hits) light[x] += light_of(hit) / static_cast<float>(side * side);
    }
    return light;
  }

 private:
  float light_of(const SimHit& hit) const {
    if (hit.surface < 0) return 0;
    const Surface& surface = lit_.world.surfaces[std::size_t(hit.surface)];
    const NodeLight light = light_at(lit_.direct[std::size_t(hit.surface)], hit.spot);
    const Eigen::Vector2f st = surface.mesh.parameters(hit.spot);
    const Eigen::Vector3d point = surface.mesh.point(hit.spot);
    const float glow = lit_.bounce.at(hit.surface, st.x(), st.y(), light.time);
    return surface.albedo.at(st.x(), st.y(), 0) * (light.diffuse + glow) /
           white_.at(static_cast<float>(point.x()), static_cast<float>(point.y()));
  }

  const LitWorld& lit_;
  WhiteReference white_;
  const Scanner& scanner_;
  const ScanOptions& options_;
};

/// encode_srgb() times the largest sample, from a table.
class Encoder {
 public:
  explicit Encoder(int bit_depth) {
    for (int i = 0; i <= cells; ++i)
      table_.push_back(static_cast<float>(encode_srgb(double(i) / cells) * ((1 << bit_depth) - 1)));
  }
  float operator()(float linear) const {
    const float position = std::clamp(linear, 0.0f, 1.0f) * cells;
    const int i = std::min(static_cast<int>(position), cells - 1);
    const auto cell = static_cast<std::size_t>(i);
    return table_[cell] + (position - static_cast<float>(i)) * (table_[cell + 1] - table_[cell]);
  }

 private:
  static constexpr int cells = 1 << 14;
  std::vector<float> table_;
};

}  // namespace

double encode_srgb(double linear) {
  const double x = std::clamp(linear, 0.0, 1.0);
  return x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1 / 2.4) - 0.055;
}

Picture render_scan(const LitWorld& lit, const Lamp& lamp, const Scanner& scanner, const ScanOptions& options,
                    std::uint64_t seed, Progress& progress) {
  progress.begin("rendering the scan");
  Picture picture = make_picture(scanner.width(), scanner.height(), 3, options.bit_depth);
  picture.icc_profile = make_srgb_profile();
  const ScanRenderer renderer(lit, lamp, scanner, options);
  const Encoder encode(options.bit_depth);
  const CounterRandom noise(seed, 0x5CA9);
  const auto render_rows = [&](auto& samples) {
    using Sample = std::remove_reference_t<decltype(samples(0, 0))>;
    const int band = 64;  // rows between two reports of progress
    for (int begin = 0; begin < scanner.height(); begin += band) {
      parallel_rows(std::min(band, scanner.height() - begin), [&](int row) {
        const int y = begin + row;
        const std::vector<float> light = renderer.light_row(y);
        for (int i = 0; i < samples.width(); ++i) {
          const float linear = light[std::size_t(i / 3)] * static_cast<float>(options.tint[std::size_t(i % 3)]);
          const auto address = std::uint64_t(y) * std::uint64_t(samples.width()) + std::uint64_t(i);
          const double error =
              options.noise * std::sqrt(0.05 + double(linear)) * fast_inverse_normal(noise.uniform(address));
          samples(i, y) = static_cast<Sample>(encode(linear + static_cast<float>(error)) + 0.5f);
        }
      });
      progress.advance(std::min(1.0, double(begin + band) / scanner.height()));
    }
  };
  std::visit(render_rows, picture.samples);
  return picture;
}

ScanMap find_scan_map(const World& world, const RayCaster& caster, int surface, const Scanner& scanner, int width,
                      int height, double pixels_per_mm) {
  const GridMesh& mesh = world.surfaces[std::size_t(surface)].mesh;
  ScanMap map(width, height);
  parallel_rows(height, [&](int j) {
    for (int i = 0; i < width; ++i) {
      const double s = (i + 0.5) / pixels_per_mm, t = (j + 0.5) / pixels_per_mm;
      if (mesh.is_missing(s, t)) continue;
      const Eigen::Vector3d point = mesh.point(mesh.spot_at(s, t));
      const auto pixel = scanner.project(point);
      if (!pixel || !scanner.sees(*pixel)) continue;
      const auto ray = scanner.ray(*pixel);
      // From just before the surface, so that it does not hide itself.
      const Eigen::Vector3d before = point - 0.05 * (point - ray->origin).normalized();
      if (caster.blocked(before.cast<float>(), ray->origin.cast<float>())) continue;
      map.u(i, j) = static_cast<float>(pixel->x());
      map.v(i, j) = static_cast<float>(pixel->y());
    }
  });
  return map;
}

}  // namespace pagesweep::sim
