// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/sim/bounce.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "pagesweep/base/parallel.h"

namespace pagesweep::sim {
namespace {

class Gathering {
 public:
  Gathering(const World& world, const RayCaster& caster, const DirectLight& direct, const Stripe& stripe,
            const BounceOptions& options)
      : world_(world), caster_(caster), direct_(direct), stripe_(stripe), directions_(cosine_directions(options.rays)) {
    for (const Surface& surface : world.surfaces) levels_.push_back(surface.albedo.level_for(options.spacing_mm));
  }

  /// Adds the light that all directions send to a place, each with the same share.
  void gather(const Outpost& outpost, std::span<float> irradiance) const {
    const Eigen::Quaterniond turn = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), outpost.normal);
    std::vector<SimRay> rays;
    for (const Eigen::Vector3d& direction : directions_)
      rays.push_back({outpost.point.cast<float>(), (turn * direction).cast<float>()});
    std::vector<SimHit> hits(rays.size());
    caster_.cast(rays, hits);
    for (const SimHit& hit : hits) {
      if (hit.surface < 0) continue;
      const auto number = static_cast<std::size_t>(hit.surface);
      const Surface& source = world_.surfaces[number];
      const NodeLight light = light_at(direct_[number], hit.spot);
      const Eigen::Vector2f st = source.mesh.parameters(hit.spot);
      const float albedo = source.albedo.at(st.x(), st.y(), levels_[number]);
      if (light.diffuse > 0)
        add_stripe(stripe_, light, albedo * light.diffuse / static_cast<float>(directions_.size()), irradiance);
    }
  }

 private:
  const World& world_;
  const RayCaster& caster_;
  const DirectLight& direct_;
  const Stripe& stripe_;
  std::vector<Eigen::Vector3d> directions_;
  std::vector<int> levels_;  ///< of each surface's texture
};

}  // namespace

void add_stripe(const Stripe& stripe, const NodeLight& light, float weight, std::span<float> frames) {
  const float reach = static_cast<float>(stripe.last_mm()) / light.speed;
  const int first = std::max(0, static_cast<int>(std::ceil(light.time - reach)));
  const int last = std::min(static_cast<int>(frames.size()) - 1, static_cast<int>(std::floor(light.time + reach)));
  for (int i = first; i <= last; ++i)
    frames[std::size_t(i)] += weight * stripe.light((static_cast<float>(i) - light.time) * light.speed);
}

std::vector<Eigen::Vector3d> cosine_directions(int count) {
  std::vector<Eigen::Vector3d> directions;
  const double golden_angle = std::numbers::pi * (3 - std::sqrt(5.0));
  for (int k = 0; k < count; ++k) {
    const double radius = std::sqrt((k + 0.5) / count), angle = k * golden_angle;
    directions.emplace_back(radius * std::cos(angle), radius * std::sin(angle), std::sqrt(1 - radius * radius));
  }
  return directions;
}

Bounce::Bounce(const World& world, const RayCaster& caster, const DirectLight& direct, const Stripe& stripe, int frames,
               const BounceOptions& options)
    : frames_(frames) {
  const Gathering gathering(world, caster, direct, stripe, options);
  for (const Surface& surface : world.surfaces) {
    const double spacing = (surface.is_measured ? 1 : 6) * options.spacing_mm;
    const std::vector<double> s = even_lines(surface.mesh.s.back(), spacing);
    const std::vector<double> t = even_lines(surface.mesh.t.back(), spacing);
    Receivers& receivers = receivers_.emplace_back();
    receivers.s_spacing = static_cast<float>(s[1] - s[0]);
    receivers.t_spacing = static_cast<float>(t[1] - t[0]);
    receivers.columns = static_cast<int>(s.size());
    receivers.rows = static_cast<int>(t.size());
    receivers.irradiance.resize(s.size() * t.size() * std::size_t(frames));
    parallel_rows(receivers.rows, [&](int j) {
      for (std::size_t i = 0; i < s.size(); ++i) {
        const std::size_t place = (std::size_t(j) * s.size() + i) * std::size_t(frames);
        gathering.gather(outpost_at(surface.mesh, s[i], t[std::size_t(j)]),
                         std::span(receivers.irradiance).subspan(place, std::size_t(frames)));
      }
    });
  }
}

std::array<Bounce::Corner, 4> Bounce::corners(int surface, float s_mm, float t_mm) const {
  const Receivers& r = receivers_[std::size_t(surface)];
  const float x = std::clamp(s_mm / r.s_spacing, 0.0f, static_cast<float>(r.columns - 1));
  const float y = std::clamp(t_mm / r.t_spacing, 0.0f, static_cast<float>(r.rows - 1));
  const int i = std::min(static_cast<int>(x), r.columns - 2), j = std::min(static_cast<int>(y), r.rows - 2);
  const float a = x - static_cast<float>(i), b = y - static_cast<float>(j);
  const auto place = [&](int column, int row) {
    return r.irradiance.data() +
           (std::size_t(row) * std::size_t(r.columns) + std::size_t(column)) * std::size_t(frames_);
  };
  return {Corner{place(i, j), (1 - a) * (1 - b)}, Corner{place(i + 1, j), a * (1 - b)},
          Corner{place(i, j + 1), (1 - a) * b}, Corner{place(i + 1, j + 1), a * b}};
}

void Bounce::add(int surface, float s_mm, float t_mm, float weight, std::span<float> frames) const {
  const auto c = corners(surface, s_mm, t_mm);
  const float w0 = weight * c[0].weight, w1 = weight * c[1].weight, w2 = weight * c[2].weight,
              w3 = weight * c[3].weight;
  for (std::size_t i = 0; i < frames.size(); ++i)
    frames[i] += w0 * c[0].frames[i] + w1 * c[1].frames[i] + w2 * c[2].frames[i] + w3 * c[3].frames[i];
}

float Bounce::at(int surface, float s_mm, float t_mm, float time_frames) const {
  const float time = std::clamp(time_frames, 0.0f, static_cast<float>(frames_ - 1));
  const int i = std::min(static_cast<int>(time), frames_ - 2);
  const float a = time - static_cast<float>(i);
  float sum = 0;
  for (const Corner& corner : corners(surface, s_mm, t_mm))
    sum += corner.weight * ((1 - a) * corner.frames[i] + a * corner.frames[i + 1]);
  return sum;
}

}  // namespace pagesweep::sim
