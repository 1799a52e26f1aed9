// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/sim/analytic_scene.h"

#include <cmath>

#include "pagesweep/base/parallel.h"
#include "pagesweep/sim/viewpoint.h"

namespace pagesweep::sim {
namespace {

/// Calls use(x, y, point) for every pixel of the camera that sees the surface.
template <class Use>
void for_each_seen(const AnalyticScene& scene, const Camera& camera, const Use& use) {
  parallel_rows(camera.height, [&](int y) {
    for (int x = 0; x < camera.width; ++x)
      if (const auto ray = camera.ray({double(x), double(y)}))
        if (const auto point = scene.meet(*ray)) use(x, y, *point);
  });
}

}  // namespace

std::optional<Eigen::Vector3d> AnalyticScene::meet(const Ray& ray) const {
  if (!(ray.direction.z() < 0)) return std::nullopt;
  const auto distance_at = [&](double z) { return (z - ray.origin.z()) / ray.direction.z(); };
  const auto above = [&](double distance) {
    const Eigen::Vector3d p = ray.at(distance);
    return p.z() - height(p.x(), p.y());
  };
  const double step = 0.5;
  double from = distance_at(highest_mm);
  const double end = distance_at(lowest_mm);
  for (double to = from + step; from < end; from = to, to += step) {
    if (!(above(from) >= 0 && above(to) <= 0)) continue;
    double low = from, high = to;
    for (int i = 0; i < 40; ++i) {
      const double middle = 0.5 * (low + high);
      (above(middle) >= 0 ? low : high) = middle;
    }
    return ray.at(0.5 * (low + high));
  }
  return std::nullopt;
}

PointMap AnalyticScene::points(const Camera& camera, double sigma_mm) const {
  PointMap map(camera.width, camera.height);
  for (PixelStatus& status : map.status.pixels()) status = PixelStatus::too_dark;
  for_each_seen(*this, camera, [&](int x, int y, const Eigen::Vector3d& p) {
    const double h = 1e-4;
    const double dx = (height(p.x() + h, p.y()) - height(p.x() - h, p.y())) / (2 * h);
    const double dy = (height(p.x(), p.y() + h) - height(p.x(), p.y() - h)) / (2 * h);
    const Eigen::Vector3f normal = Eigen::Vector3d(-dx, -dy, 1).normalized().cast<float>();
    map.x(x, y) = static_cast<float>(p.x());
    map.y(x, y) = static_cast<float>(p.y());
    map.z(x, y) = static_cast<float>(p.z());
    map.nx(x, y) = normal.x();
    map.ny(x, y) = normal.y();
    map.nz(x, y) = normal.z();
    map.intensity(x, y) = 100;
    map.sigma(x, y) = static_cast<float>(sigma_mm);
    map.status(x, y) = PixelStatus::ok;
  });
  return map;
}

TimeMap AnalyticScene::times(const Camera& camera, const Light& light, double sigma_frames) const {
  TimeMap map(camera.width, camera.height);
  for (PixelStatus& status : map.status.pixels()) status = PixelStatus::too_dark;
  for_each_seen(*this, camera, [&](int x, int y, const Eigen::Vector3d& p) {
    const auto time = light.time_of(p);
    if (!time) return;
    map.time(x, y) = static_cast<float>(*time);
    map.sigma(x, y) = static_cast<float>(sigma_frames);
    map.amplitude(x, y) = 100;
    map.residual(x, y) = 1;
    map.status(x, y) = PixelStatus::ok;
  });
  return map;
}

Correspondences AnalyticScene::correspondences(const Camera& from, const Camera& to) const {
  Correspondences map(from.width, from.height);
  for (PixelStatus& status : map.status.pixels()) status = PixelStatus::no_match;
  for_each_seen(*this, from, [&](int x, int y, const Eigen::Vector3d& p) {
    const auto pixel = to.project(p);
    if (!pixel || !to.sees(*pixel)) {
      map.status(x, y) = PixelStatus::outside_view;
      return;
    }
    map.u(x, y) = static_cast<float>(pixel->x());
    map.v(x, y) = static_cast<float>(pixel->y());
    map.sigma(x, y) = 0.05f;
    map.status(x, y) = PixelStatus::ok;
  });
  return map;
}

Rig make_test_rig(int width_px) {
  Rig rig;
  for (const int side : {-1, 1}) {
    Camera camera;
    camera.name = side < 0 ? "cam1" : "cam2";
    camera.width = camera.height = width_px;
    camera.fx = camera.fy = 1.45 * width_px;
    camera.cx = camera.cy = (width_px - 1) / 2.0;
    camera.distortion = {-0.08, 0.02, 4e-4, -3e-4, 0};
    camera.cam_from_rig = looking_at({0, side * 200.0, 640}, {0, side * 10.0, 20});
    rig.cameras.push_back(camera);
  }
  Pushbroom line;
  line.width = 4960;
  line.height = 3508;
  const double pixels_per_mm = 300 / 25.4, height_mm = 700;
  line.f = pixels_per_mm * height_mm;
  line.cx = (line.width - 1) / 2.0;
  line.rotation = Eigen::Vector3d(1, -1, -1).asDiagonal();
  line.step = {0, -1 / pixels_per_mm, 0};
  line.center = {0, (line.height - 1) / 2.0 / pixels_per_mm, height_mm};
  rig.scanner = Scanner(line);
  rig.light = Light(TranslatingPlane{Eigen::Vector3d::UnitY(), -170, 1.7});
  return rig;
}

}  // namespace pagesweep::sim
