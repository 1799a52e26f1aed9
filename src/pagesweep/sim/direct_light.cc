// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/sim/direct_light.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "pagesweep/base/parallel.h"

namespace pagesweep::sim {
namespace {

/// A piece of the bar as a point of the scene sees it.
struct Emitter {
  Eigen::Vector3d position;
  Eigen::Vector3d direction;  ///< from the point towards it, unit length
  double intensity;           ///< its length times cos(emission) / distance^2
};

Emitter emitter_at(const Lamp& lamp, const Eigen::Vector3d& middle, int k, int samples, const Eigen::Vector3d& point) {
  const double piece = lamp.length_mm() / samples;
  Emitter emitter;
  emitter.position = middle + ((k + 0.5) * piece - 0.5 * lamp.length_mm()) * lamp.along();
  const Eigen::Vector3d arm = emitter.position - point;
  const double distance = arm.norm();
  emitter.direction = arm / distance;
  const double sine = emitter.direction.dot(lamp.along());
  emitter.intensity = piece * std::sqrt(std::max(0.0, 1 - sine * sine)) / (distance * distance);
  return emitter;
}

double level_irradiance(const Lamp& lamp, const Eigen::Vector3d& point) {
  const int samples = 200;
  const Eigen::Vector3d middle = lamp.middle_at(lamp.time_of(point));
  double sum = 0;
  for (int k = 0; k < samples; ++k) {
    const Emitter emitter = emitter_at(lamp, middle, k, samples, point);
    sum += emitter.intensity * std::max(0.0, emitter.direction.z());
  }
  return sum;
}

/// The lobe times pi, so that it compares with an albedo.
double lobe(const Gloss& gloss, double cos_half) {
  return gloss.strength * (gloss.exponent + 8) / 8 * std::pow(std::max(0.0, cos_half), gloss.exponent);
}

struct NodeLighting {
  const RayCaster& caster;
  const Lamp& lamp;
  std::span<const Eigen::Vector3d> viewers;
  int samples;
  double unit;  ///< irradiance that counts as 1

  NodeLight light_node(const Surface& surface, int i, int j) const {
    const GridMesh& mesh = surface.mesh;
    const Outpost outpost = outpost_at(mesh, mesh.s[std::size_t(i)], mesh.t[std::size_t(j)]);
    const Eigen::Vector3d middle = lamp.middle_at(lamp.time_of(outpost.point));
    double diffuse = 0, gloss[most_viewers] = {};
    for (int k = 0; k < samples; ++k) {
      const Emitter emitter = emitter_at(lamp, middle, k, samples, outpost.point);
      const double cosine = emitter.direction.dot(outpost.normal);
      if (cosine <= 0 || caster.blocked(outpost.point.cast<float>(), emitter.position.cast<float>())) continue;
      const double share = emitter.intensity * cosine / unit;
      diffuse += share;
      if (surface.gloss.strength == 0) continue;
      for (std::size_t v = 0; v < viewers.size(); ++v) {
        const Eigen::Vector3d half = (emitter.direction + (viewers[v] - outpost.point).normalized()).normalized();
        gloss[v] += share * lobe(surface.gloss, half.dot(outpost.normal));
      }
    }
    NodeLight light;
    light.time = static_cast<float>(lamp.time_of(mesh.positions(i, j)));
    light.speed = static_cast<float>(lamp.speed_at(mesh.positions(i, j)));
    light.diffuse = static_cast<float>(diffuse);
    for (int v = 0; v < most_viewers; ++v) light.gloss[v] = static_cast<float>(gloss[v]);
    return light;
  }
};

}  // namespace

Outpost outpost_at(const GridMesh& mesh, double s_mm, double t_mm) {
  const double inset = 0.4, lift = 0.03;  // [mm]; at 50 degrees on either side of a gutter this is in the open
  const auto keep_in = [&](double value, const std::vector<double>& lines) {
    const double margin = std::min(inset, 0.25 * (lines.back() - lines.front()));
    return std::clamp(value, lines.front() + margin, lines.back() - margin);
  };
  const MeshSpot spot = mesh.spot_at(keep_in(s_mm, mesh.s), keep_in(t_mm, mesh.t));
  const Eigen::Vector3d normal = mesh.normal(spot).cast<double>().normalized();
  return {mesh.point(spot) + lift * normal, normal};
}

double open_irradiance(const Lamp& lamp, const Eigen::Vector3d& point) {
  return level_irradiance(lamp, point) / level_irradiance(lamp, Eigen::Vector3d::Zero());
}

NodeLight light_at(const std::vector<NodeLight>& nodes, const MeshSpot& spot) {
  NodeLight light;
  for (std::size_t k = 0; k < 3; ++k) {
    const NodeLight& node = nodes[spot.node[k]];
    const float weight = spot.weight[k];
    light.time += weight * node.time;
    light.speed += weight * node.speed;
    light.diffuse += weight * node.diffuse;
    for (int viewer = 0; viewer < most_viewers; ++viewer) light.gloss[viewer] += weight * node.gloss[viewer];
  }
  return light;
}

DirectLight light_surfaces(const World& world, const RayCaster& caster, const Lamp& lamp,
                           std::span<const Eigen::Vector3d> viewers, int samples) {
  const NodeLighting lighting{caster, lamp, viewers, samples, level_irradiance(lamp, Eigen::Vector3d::Zero())};
  DirectLight lights;
  for (const Surface& surface : world.surfaces) {
    std::vector<NodeLight>& nodes = lights.emplace_back(surface.mesh.nodes());
    parallel_rows(surface.mesh.rows(), [&](int j) {
      const int columns = surface.mesh.columns();
      for (int i = 0; i < columns; ++i)
        nodes[std::size_t(j) * std::size_t(columns) + std::size_t(i)] = lighting.light_node(surface, i, j);
    });
  }
  return lights;
}

}  // namespace pagesweep::sim
