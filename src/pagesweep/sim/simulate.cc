// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/sim/simulate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "pagesweep/base/parallel.h"

namespace pagesweep::sim {
namespace {

constexpr double wall_albedo = 0.6;   ///< of a page block's edges
constexpr double wall_gap_mm = 0.02;  ///< between a page's edge and its wall, so that rays along the edge find the page

/// The world of a scene, and where its pages are in it.
struct Stage {
  World world;
  std::vector<int> page_surfaces;
  std::vector<SimulatedPage> pages;  ///< without what depends on the scanner
};

void add_page(const ScenePage& page, const RenderQuality& quality, Stage& stage, Progress& progress) {
  const int number = static_cast<int>(stage.pages.size()) + 1;
  const double pixels_per_mm = quality.page_dpi / 25.4;
  PrintedSheet print = print_sheet(page.print, pixels_per_mm);
  if (print.text_was_cut) progress.warn(fmt::format("page {}: not all of the text found room", number));
  Sheet sheet = bend_sheet(page.shape, quality.mesh_mm);
  if (page.on_block)
    for (GridMesh& wall : make_walls(sheet.mesh)) {
      for (Eigen::Vector3d& point : wall.positions.pixels()) point.z() = std::max(0.0, point.z() - wall_gap_mm);
      stage.world.surfaces.push_back({.mesh = std::move(wall), .albedo = Texture(float(wall_albedo))});
    }
  stage.page_surfaces.push_back(static_cast<int>(stage.world.surfaces.size()));
  stage.world.surfaces.push_back({.mesh = std::move(sheet.mesh),
                                  .albedo = Texture(print.albedo, pixels_per_mm),
                                  .gloss = page.gloss,
                                  .is_measured = true,
                                  .page = number});
  stage.pages.push_back({.albedo = std::move(print.albedo),
                         .pixels_per_mm = pixels_per_mm,
                         .text = std::move(print.text),
                         .largest_strain = sheet.largest_strain});
}

Stage build_stage(const Scene& scene, Progress& progress) {
  progress.begin("bending and printing the paper");
  Stage stage;
  stage.world.surfaces.push_back({.mesh = make_rectangle({-340, -280, 0}, 680, 560, 3 * scene.quality.mesh_mm),
                                  .albedo = Texture(static_cast<float>(scene.table_albedo))});
  for (const ScenePage& page : scene.pages) add_page(page, scene.quality, stage, progress);
  for (const Obstacle& obstacle : scene.obstacles) {
    const auto below = std::size_t(stage.page_surfaces[std::size_t(obstacle.page - 1)]);
    stage.world.surfaces.push_back(
        {.mesh = make_obstacle(obstacle, stage.world.surfaces[below].mesh, scene.quality.mesh_mm),
         .albedo = Texture(static_cast<float>(obstacle.albedo))});
  }
  for (const SceneSphere& sphere : scene.spheres)
    stage.world.surfaces.push_back(
        {.mesh = make_sphere(sphere.center_mm, sphere.radius_mm, 0.3 * scene.quality.mesh_mm),
         .albedo = Texture(static_cast<float>(sphere.albedo)),
         .gloss = sphere.gloss,
         .is_measured = true});
  return stage;
}

Image<Eigen::Vector3f> find_page_points(const GridMesh& mesh, const SimulatedPage& page, int subsampling) {
  const auto subsampled = [&](int size) { return (size + subsampling - 1) / subsampling; };
  Image<Eigen::Vector3f> points(subsampled(page.albedo.width()), subsampled(page.albedo.height()));
  for (int j = 0; j < points.height(); ++j)
    for (int i = 0; i < points.width(); ++i) {
      const double s = (i * subsampling + 0.5) / page.pixels_per_mm, t = (j * subsampling + 0.5) / page.pixels_per_mm;
      if (mesh.is_missing(s, t)) {
        points(i, j).setConstant(not_a_number);
        continue;
      }
      points(i, j) = mesh.point(mesh.spot_at(s, t)).cast<float>();
    }
  return points;
}

/// The spots that the scan does not show.
Image<std::uint8_t> find_fates(const GridMesh& mesh, const SimulatedPage& page) {
  Image<std::uint8_t> fates(page.albedo.width(), page.albedo.height(), std::uint8_t(SpotFate::seen));
  parallel_rows(fates.height(), [&](int j) {
    for (int i = 0; i < fates.width(); ++i)
      if (mesh.is_missing((i + 0.5) / page.pixels_per_mm, (j + 0.5) / page.pixels_per_mm))
        fates(i, j) = std::uint8_t(SpotFate::torn);
      else if (std::isnan(page.scan_map.u(i, j)))
        fates(i, j) = std::uint8_t(SpotFate::covered);
  });
  return fates;
}

/// Where every spot of the pages went.
void note_page_truth(Stage& stage, const RayCaster& caster, Simulation& result, Progress& progress) {
  progress.begin("noting the truth");
  const Scene& scene = result.scene;
  result.pages = std::move(stage.pages);
  for (std::size_t k = 0; k < result.pages.size(); ++k) {
    SimulatedPage& page = result.pages[k];
    const int surface = stage.page_surfaces[k];
    const GridMesh& mesh = stage.world.surfaces[std::size_t(surface)].mesh;
    page.points = find_page_points(mesh, page, scene.quality.points_subsampling);
    if (scene.rig.scanner)
      page.scan_map = find_scan_map(stage.world, caster, surface, *scene.rig.scanner, page.albedo.width(),
                                    page.albedo.height(), page.pixels_per_mm);
    const bool is_whole = mesh.missing.pixels().empty() && scene.obstacles.empty();
    if (scene.rig.scanner && !is_whole) page.fates = find_fates(mesh, page);
  }
}

/// Takes the light from what the cameras do not see.
void darken_blind_areas(const Scene& scene, const Image<Eigen::Vector3f>& points, Frames& frames) {
  if (scene.blind_areas.empty()) return;
  const auto is_blind = [&](const Eigen::Vector3f& point) {
    return std::ranges::any_of(scene.blind_areas, [&](const BlindArea& area) { return area.contains(point); });
  };
  for (int k = 0; k < frames.count(); ++k) {
    GrayImage frame = frames.frame(k);
    std::visit(
        [&](auto& samples) {
          using Sample = std::remove_reference_t<decltype(samples(0, 0))>;
          for (std::size_t i = 0; i < samples.size(); ++i)
            if (is_blind(points.data()[i])) samples.data()[i] = static_cast<Sample>(scene.sensor.black_level);
        },
        frame);
    frames.set(k, std::move(frame));
  }
}

void require_sound(const Scene& scene) {
  if (scene.rig.cameras.empty() || scene.rig.cameras.size() > most_viewers)
    throw std::invalid_argument("a scene has one or two cameras");
  if (scene.camera.frames < 2) throw std::invalid_argument("a scene has at least two frames");
}

}  // namespace

Simulation simulate(const Scene& full_scene, const SimulateOptions& options, Progress& progress) {
  Simulation result;
  result.scene = options.preview ? preview_of(full_scene) : full_scene;
  const Scene& scene = result.scene;
  require_sound(scene);
  Stage stage = build_stage(scene, progress);
  const World& world = stage.world;
  result.rig = scene.rig;
  result.rig.light = scene.lamp.light;

  progress.begin("lighting the scene");
  const RayCaster caster = world.make_ray_caster();
  const Lamp lamp(scene.lamp.light, scene.lamp.height_mm, scene.lamp.length_mm);
  const Stripe stripe(scene.lamp.shape, scene.lamp.fwhm_mm, scene.lamp.softness);
  std::vector<Eigen::Vector3d> viewers;
  for (const Camera& camera : scene.rig.cameras) viewers.push_back(camera.center());
  const DirectLight direct = light_surfaces(world, caster, lamp, viewers, scene.quality.bar_samples);
  progress.advance(0.5);
  const Bounce bounce(world, caster, direct, stripe, scene.camera.frames, scene.quality.bounce);
  const LitWorld lit{world, caster, direct, bounce, stripe};

  const auto seed = static_cast<std::uint64_t>(options.seed);
  for (std::size_t k = 0; k < scene.rig.cameras.size(); ++k) {
    const Camera& camera = scene.rig.cameras[k];
    result.frames.push_back(
        render_camera(lit, camera, static_cast<int>(k), scene.camera, scene.sensor, seed, progress));
    result.camera_points.push_back(find_camera_points(world, caster, camera));
    darken_blind_areas(scene, result.camera_points.back(), result.frames.back());
  }
  if (scene.rig.scanner) {
    result.scan = render_scan(lit, lamp, *scene.rig.scanner, scene.scan, seed, progress);
    result.scan.pixels_per_mm = result.rig.scanner->project_jacobian(Eigen::Vector3d::Zero()).row(0).norm();
  }

  note_page_truth(stage, caster, result, progress);
  return result;
}

void simulate(const Scene& scene, const std::filesystem::path& folder, const SimulateOptions& options,
              Progress& progress) {
  write_simulation(simulate(scene, options, progress), folder, progress);
}

}  // namespace pagesweep::sim
