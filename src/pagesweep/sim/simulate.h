// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "pagesweep/base/progress.h"
#include "pagesweep/camera/rig.h"
#include "pagesweep/data/frames.h"
#include "pagesweep/data/page.h"
#include "pagesweep/data/picture.h"
#include "pagesweep/sim/scene.h"

namespace pagesweep::sim {

struct SimulateOptions {
  bool preview = false;
  int seed = 1;
  template <class Visitor>
  void describe(Visitor&& visit) {
    visit("preview", preview, "",
          "render a small capture within seconds: quarter-size cameras, half the frames, a third "
          "of the scan's resolution");
    visit("seed", seed, "", "of the noise: another number, another noise; the same number, the same files");
  }
};

/// What became of a spot of a page, in the scan.
enum class SpotFate : std::uint8_t { seen = 0, covered = 1, torn = 2 };

/// What is printed on a page and where every spot of it went.
struct SimulatedPage {
  Image<float> albedo;  ///< flat, as printed
  double pixels_per_mm = 0;
  std::string text = {};               ///< empty: none
  ScanMap scan_map = {};               ///< of each pixel
  Image<Eigen::Vector3f> points = {};  ///< [mm] rig frame, of each points_subsampling-th pixel
  Image<std::uint8_t> fates = {};  ///< a SpotFate a pixel; empty if nothing lies on the page and nothing is torn off
  double largest_strain = 0;       ///< of the bent paper, relative
};

/// A capture with its truth, in memory.
struct Simulation {
  Scene scene;  ///< as rendered: the preview's if that was asked for
  Rig rig;
  std::vector<Frames> frames;  ///< a camera each
  Picture scan;
  std::vector<Image<Eigen::Vector3f>>
      camera_points;  ///< [mm] a camera each; NaN where it hits nothing that is measured
  std::vector<SimulatedPage> pages;
};

/// Renders a scene.
/// \throws std::invalid_argument  if the scene contradicts itself
Simulation simulate(const Scene& scene, const SimulateOptions& options, Progress& progress = no_progress());

/// Writes a capture folder with its truth (docs/formats.md).
/// \throws Error  if it cannot be written
void write_simulation(const Simulation& simulation, const std::filesystem::path& folder,
                      Progress& progress = no_progress());

/// Renders a scene into a capture folder.
void simulate(const Scene& scene, const std::filesystem::path& folder, const SimulateOptions& options,
              Progress& progress = no_progress());

}  // namespace pagesweep::sim
