// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/sim/scene.h"

#include <cmath>
#include <type_traits>

#include "pagesweep/sim/viewpoint.h"

namespace pagesweep::sim {
namespace {

/// The camera with `factor` times as many pixels a side over the same field of view.
Camera resized(Camera camera, double factor) {
  camera.width = static_cast<int>(std::lround(camera.width * factor));
  camera.height = static_cast<int>(std::lround(camera.height * factor));
  camera.fx *= factor;
  camera.fy *= factor;
  camera.cx = (camera.cx + 0.5) * factor - 0.5;
  camera.cy = (camera.cy + 0.5) * factor - 0.5;
  return camera;
}

/// Likewise for a line sensor, whose rows are instants.
template <class Line>
Line resized_line(Line line, double factor) {
  line.width = static_cast<int>(std::lround(line.width * factor));
  line.height = static_cast<int>(std::lround(line.height * factor));
  line.f *= factor;
  line.cx = (line.cx + 0.5) * factor - 0.5;
  return line;
}

/// The first row of the smaller scan is centred where this row of the full one was.
double first_row(double factor) { return 0.5 / factor - 0.5; }

Scanner::Model resized(const Pushbroom& full, double factor) {
  Pushbroom line = resized_line(full, factor);
  line.center += first_row(factor) * full.step;
  line.step = full.step / factor;
  return line;
}

Scanner::Model resized(const RotatingLine& full, double factor) {
  RotatingLine line = resized_line(full, factor);
  line.angle0 += first_row(factor) * full.angle_step;
  line.angle_step = full.angle_step / factor;
  return line;
}

}  // namespace

Rig make_default_rig() {
  Rig rig;
  for (const int side : {-1, 1}) {
    Camera camera;
    camera.name = side < 0 ? "cam1" : "cam2";
    camera.width = camera.height = 1024;
    camera.fx = camera.fy = 1480;
    camera.cx = 511.5 + 4.3 * side;
    camera.cy = 511.5 - 2.9 * side;
    camera.distortion = {-0.08, 0.02, 4e-4, -3e-4, 0};
    camera.cam_from_rig = looking_at({-2.0 * side, side * 200.0, 645}, {1.0 * side, side * 10.0, 15}, 0.004 * side);
    rig.cameras.push_back(camera);
  }
  const double pixels_per_mm = 300 / 25.4;
  Pushbroom line;
  line.width = 4960;
  line.height = 3508;
  line.center = {0, 0.5 * (line.height - 1) / pixels_per_mm, 700};
  line.f = pixels_per_mm * line.center.z();
  line.cx = 0.5 * (line.width - 1);
  line.rotation = Eigen::Vector3d(1, -1, -1).asDiagonal();
  line.step = {0, -1 / pixels_per_mm, 0};
  rig.scanner = Scanner(line);
  return rig;
}

Scene preview_of(Scene scene) {
  for (Camera& camera : scene.rig.cameras) camera = resized(camera, 0.25);
  if (scene.rig.scanner)
    scene.rig.scanner =
        std::visit([](const auto& model) { return Scanner(resized(model, 1.0 / 3)); }, scene.rig.scanner->model());
  scene.camera.frames = (scene.camera.frames + 1) / 2;
  scene.lamp.light = scene.lamp.light.sped_up(2);
  scene.lamp.fwhm_mm *= 1.5;
  scene.camera.rays_per_side = 6;
  scene.scan.rays_per_side = 2;
  scene.quality = {.mesh_mm = 2,
                   .page_dpi = 100,
                   .bar_samples = 24,
                   .points_subsampling = 4,
                   .bounce = {.spacing_mm = 4, .rays = 256}};
  return scene;
}

}  // namespace pagesweep::sim
