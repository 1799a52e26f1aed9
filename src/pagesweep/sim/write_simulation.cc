// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "pagesweep/base/parallel.h"
#include "pagesweep/io/atomic_file.h"
#include "pagesweep/io/capture_file.h"
#include "pagesweep/io/float_tiff.h"
#include "pagesweep/io/image_file.h"
#include "pagesweep/io/json_file.h"
#include "pagesweep/io/rig_file.h"
#include "pagesweep/io/truth_file.h"
#include "pagesweep/sim/simulate.h"

namespace pagesweep::sim {
namespace {

namespace fs = std::filesystem;

void write_frames(const Frames& frames, const Capture& capture, const SequenceFiles& files, Progress& progress) {
  progress.begin("writing the frames of " + files.camera);
  const int band = 16;  // frames between two reports of progress
  for (int begin = 0; begin < frames.count(); begin += band) {
    parallel_rows(std::min(band, frames.count() - begin),
                  [&](int k) { write_gray_png(capture.frame_path(files, begin + k), frames.frame(begin + k), 1); });
    progress.advance(std::min(1.0, double(begin + band) / frames.count()));
  }
}

void write_capture_files(const Simulation& simulation, const fs::path& folder, Progress& progress) {
  Capture capture;
  capture.folder = folder;
  capture.notes = "simulated: " + simulation.scene.about;
  write_rig(folder / capture.rig, simulation.rig);
  for (const Frames& frames : simulation.frames) {
    const Sequence& sequence = frames.sequence();
    capture.sequences.push_back({sequence.camera, sequence.camera + "/%06d.png", 0, sequence.count, sequence.bit_depth,
                                 sequence.black_level, sequence.saturation, simulation.scene.camera.exposures});
    write_frames(frames, capture, capture.sequences.back(), progress);
  }
  if (simulation.rig.scanner) {
    progress.begin("writing the scan");
    capture.scan = simulation.scan.bit_depth() == 8 ? "scan.png" : "scan.tif";
    write_picture(folder / *capture.scan, simulation.scan);
  }
  write_capture(capture);
}

/// The print as a scan of the flat page would show it.
Picture flat_picture(const SimulatedPage& page) {
  Picture picture = make_picture(page.albedo.width(), page.albedo.height(), 1, 8);
  picture.pixels_per_mm = page.pixels_per_mm;
  auto& samples = std::get<Image<std::uint8_t>>(picture.samples);
  parallel_rows(samples.height(), [&](int y) {
    for (int x = 0; x < samples.width(); ++x)
      samples(x, y) = static_cast<std::uint8_t>(255 * encode_srgb(double(page.albedo(x, y))) + 0.5);
  });
  return picture;
}

/// The stripe over time at the height of the table.
TruthProfile profile_at_table(const Scene& scene, double mm_per_frame) {
  const Stripe stripe(scene.lamp.shape, scene.lamp.fwhm_mm, scene.lamp.softness);
  TruthProfile profile;
  profile.step_frames = 0.125;
  const int reach = static_cast<int>(std::ceil(stripe.last_mm() / mm_per_frame / profile.step_frames));
  profile.start_frames = -reach * profile.step_frames;
  for (int k = -reach; k <= reach; ++k) {
    const double light = double(stripe.light(static_cast<float>(k * profile.step_frames * mm_per_frame)));
    profile.values.push_back(std::round(light * 1e6) / 1e6);
  }
  return profile;
}

/// What only a simulator can say, beside the fields of the format.
void add_extensions(const Simulation& simulation, const fs::path& file) {
  auto json = nlohmann::ordered_json::parse(read_bytes(file, 1 << 26));
  for (std::size_t k = 0; k < simulation.pages.size(); ++k)
    json["pages"][k]["largest_strain"] = simulation.pages[k].largest_strain;
  const auto list = [](const Eigen::Vector3d& v) { return nlohmann::ordered_json{v.x(), v.y(), v.z()}; };
  for (const SceneSphere& sphere : simulation.scene.spheres)
    json["spheres"].push_back({{"center_mm", list(sphere.center_mm)}, {"radius_mm", sphere.radius_mm}});
  if (simulation.scene.spheres.size() == 2)
    json["sphere_distance_mm"] = (simulation.scene.spheres[1].center_mm - simulation.scene.spheres[0].center_mm).norm();
  json["psf_sigma_px"] = simulation.scene.camera.psf_sigma_px;
  json["ambient"] = simulation.scene.camera.ambient;
  write_json(file, json);
}

void write_truth_files(const Simulation& simulation, const fs::path& folder, Progress& progress) {
  progress.begin("writing the truth");
  const Scene& scene = simulation.scene;
  Truth truth;
  truth.folder = folder;
  for (std::size_t k = 0; k < simulation.frames.size(); ++k)
    write_vector_tiff(truth.camera_points_path(simulation.rig.cameras[k].name), simulation.camera_points[k]);
  for (const SimulatedPage& page : simulation.pages) {
    const int index = static_cast<int>(truth.pages.size()) + 1;
    const std::string text = page.text.empty() ? "" : fmt::format("page_{}.txt", index);
    truth.pages.push_back({index, page.pixels_per_mm, scene.quality.points_subsampling, text});
    write_picture(truth.page_path(index), flat_picture(page));
    if (simulation.rig.scanner) write_scan_map(truth.page_scan_map_path(index), page.scan_map);
    write_vector_tiff(truth.page_points_path(index), page.points);
    if (!page.fates.pixels().empty())
      write_gray_png(folder / fmt::format("page_{}_fates.png", index), page.fates.view());
    if (!text.empty()) write_bytes(folder / text, page.text + "\n");
    progress.advance(double(index) / double(simulation.pages.size()));
  }
  const Lamp lamp(scene.lamp.light, scene.lamp.height_mm, scene.lamp.length_mm);
  const double mm_per_frame = lamp.speed_at(Eigen::Vector3d::Zero());
  truth.stripe = TruthStripe{mm_per_frame, scene.lamp.fwhm_mm};
  const double gain = scene.sensor.gain();
  truth.sensor = TruthSensor{gain, scene.sensor.read_noise_electrons / gain};
  truth.profile = profile_at_table(scene, mm_per_frame);
  write_truth(truth);
  add_extensions(simulation, folder / "truth.json");
}

}  // namespace

void write_simulation(const Simulation& simulation, const fs::path& folder, Progress& progress) {
  write_truth_files(simulation, folder / "truth", progress);
  write_capture_files(simulation, folder, progress);
}

}  // namespace pagesweep::sim
