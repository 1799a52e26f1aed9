// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "pagesweep/camera/rig.h"
#include "pagesweep/sim/obstacle.h"
#include "pagesweep/sim/paper.h"
#include "pagesweep/sim/print.h"
#include "pagesweep/sim/render_scan.h"
#include "pagesweep/sim/sensor.h"
#include "pagesweep/sim/stripe.h"
#include "pagesweep/sim/world.h"

namespace pagesweep::sim {

struct ScenePage {
  SheetShape shape;
  PrintDesign print;
  Gloss gloss;
  bool on_block = false;  ///< the page is the topmost of a block of pages: its edges are closed down to the table
};

struct SceneSphere {
  Eigen::Vector3d center_mm = Eigen::Vector3d::Zero();
  double radius_mm = 20;
  double albedo = 0.85;
  Gloss gloss;
};

/// A rectangle on the table. What lies above it no camera sees, as if a thing stood in front of their lenses: it is
/// dark in all frames. The scanner does see it.
struct BlindArea {
  double low_x_mm = 0, low_y_mm = 0, high_x_mm = 0, high_y_mm = 0;
  bool contains(const Eigen::Vector3f& point) const {
    return double(point.x()) >= low_x_mm && double(point.x()) <= high_x_mm && double(point.y()) >= low_y_mm &&
           double(point.y()) <= high_y_mm;
  }
};

struct SceneLamp {
  Light light = Light(TranslatingPlane{Eigen::Vector3d::UnitY(), -170, 1.7});
  double height_mm = 600;  ///< of the bar above the table
  double length_mm = 560;  ///< of the bar
  StripeShape shape = StripeShape::gaussian;
  double fwhm_mm = 12;    ///< full width at half maximum on the table below the bar
  double softness = 0.5;  ///< see Stripe
};

/// How finely a scene is rendered.
struct RenderQuality {
  double mesh_mm = 1;          ///< spacing of the pages' meshes
  double page_dpi = 300;       ///< of the print and its truth
  int bar_samples = 48;        ///< of the lamp's bar
  int points_subsampling = 8;  ///< of the truth's page points
  BounceOptions bounce;
};

/// Everything that a scene file says, with the defaults for what it leaves out.
struct Scene {
  std::string about;
  std::vector<ScenePage> pages;  ///< from left to right
  std::vector<SceneSphere> spheres;
  std::vector<Obstacle> obstacles;
  std::vector<BlindArea> blind_areas;
  double table_albedo = 0.04;
  Rig rig;  ///< cameras and scanner; its light is lamp.light
  SceneLamp lamp;
  CameraOptions camera;
  SensorModel sensor;
  ScanOptions scan;
  RenderQuality quality;
};

/// The rig that a scene has if its file says nothing: two cameras of 1024 x 1024 pixels about 640 mm above the table,
/// 400 mm apart along the sweep, a pushbroom scanner of 300 dpi over 420 mm x 297 mm.
Rig make_default_rig();

/// Reads a scene file (docs: scenes/README.md).
/// \throws Error  that names file, field and what was expected
Scene read_scene(const std::filesystem::path& file);

/// The same scene, small: cameras of a quarter of the side, half the frames, a scan of a third of the resolution. The
/// stripe moves twice as fast and is half again as wide, so that a pixel still sees it in more than five frames.
Scene preview_of(Scene scene);

}  // namespace pagesweep::sim
