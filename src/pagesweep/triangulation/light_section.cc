// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/triangulation/light_section.h"

namespace pagesweep {
namespace {

double distance_to_light(const Light& light, const Ray& ray, double time_frames) {
  const Plane plane = light.plane_at(time_frames);
  return -plane.distance(ray.origin) / plane.normal.dot(ray.direction);
}

}  // namespace

LightSection section(const Light& light, const Ray& ray, double time_frames) {
  // The distance is a rational function of the time that changes little in a frame, so the central difference over
  // 0.02 frames is exact to 1e-6 of itself.
  constexpr double h = 0.01;
  return {distance_to_light(light, ray, time_frames),
          (distance_to_light(light, ray, time_frames + h) - distance_to_light(light, ray, time_frames - h)) / (2 * h)};
}

}  // namespace pagesweep
