// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/sim/board_series.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <cmath>
#include <stdexcept>

#include "pagesweep/io/board_file.h"
#include "pagesweep/io/image_file.h"
#include "pagesweep/io/rig_file.h"
#include "pagesweep/sim/viewpoint.h"

namespace pagesweep::sim {
namespace {

constexpr double table_width_mm = 420, table_depth_mm = 297, distance_mm = 700;

/// What pushbroom and rotating line have in common.
template <class Line>
Line make_line(double dpi) {
  const double pixels_per_mm = dpi / 25.4;
  Line line;
  line.width = static_cast<int>(std::lround(table_width_mm * pixels_per_mm));
  line.height = static_cast<int>(std::lround(table_depth_mm * pixels_per_mm));
  line.f = pixels_per_mm * distance_mm;
  line.cx = 0.5 * (line.width - 1) + 0.004 * line.width;
  line.k1 = 0.02;
  const Eigen::Matrix3d downwards = Eigen::Vector3d(1, -1, -1).asDiagonal();
  line.rotation = Eigen::AngleAxisd(0.01, Eigen::Vector3d(1, 0.5, 0.3).normalized()).toRotationMatrix() * downwards;
  return line;
}

struct Seen {
  std::string name;
  Scanner sensor;
};

std::vector<Seen> sensors_of(const Rig& rig) {
  std::vector<Seen> sensors;
  for (const Camera& camera : rig.cameras) sensors.push_back({camera.name, Scanner(camera)});
  if (rig.scanner) sensors.push_back({"scanner", *rig.scanner});
  return sensors;
}

}  // namespace

Scanner make_skewed_scanner(ScannerModel model, double dpi) {
  const double pixels_per_mm = dpi / 25.4;
  if (model == ScannerModel::pushbroom) {
    auto line = make_line<Pushbroom>(dpi);
    line.center = {4, 0.5 * (line.height - 1) / pixels_per_mm - 3, distance_mm};
    line.step = {0.001 / pixels_per_mm, -1 / pixels_per_mm, 0.002 / pixels_per_mm};
    return Scanner(line);
  }
  if (model == ScannerModel::rotating_line) {
    auto line = make_line<RotatingLine>(dpi);
    line.center = {5, 10, distance_mm};
    line.angle_step = 1 / (pixels_per_mm * distance_mm);
    line.angle0 = -0.5 * (line.height - 1) * line.angle_step;
    return Scanner(line);
  }
  const auto line = make_line<Pushbroom>(dpi);
  Camera camera;
  camera.name = "scanner";
  camera.width = line.width, camera.height = line.height;
  camera.fx = camera.fy = line.f;
  camera.cx = line.cx, camera.cy = 0.5 * (line.height - 1);
  camera.distortion = {-0.05, 0.01, 2e-4, -1e-4, 0};
  camera.cam_from_rig = looking_at({3, 5, distance_mm}, {0, 0, 0}, 0.005);
  return Scanner(camera);
}

void write_board_series(const Rig& rig, const Board& board, const BoardDrawing& drawing,
                        const BoardSeriesOptions& options, const SensorModel& sensor_model, int seed,
                        const std::filesystem::path& folder, Progress& progress) {
  if (options.poses < 1 || options.poses > 1000) throw std::invalid_argument("--poses must be from 1 to 1000");
  if (!(options.scan_dpi >= 20 && options.scan_dpi <= 1200))
    throw std::invalid_argument("--scan-dpi must be 20 to 1200");
  Rig truth = rig;
  truth.light.reset();
  truth.scanner.reset();
  if (options.scanner != SeriesScanner::none)
    truth.scanner =
        make_skewed_scanner(static_cast<ScannerModel>(static_cast<int>(options.scanner) - 1), options.scan_dpi);
  BoardRenderOptions render;
  render.psf_sigma_px = options.blur_px;
  render.exposure = options.exposure;
  render.sensor = sensor_model;
  const Eigen::Vector2d size = board.size_mm();
  const auto poses = board_poses(size, {160, 100}, options.highest_mm, options.poses, static_cast<std::uint64_t>(seed));
  PlacedBoard placed{&drawing, board.print_scale, {}, {}};
  if (options.bend_mm != 0)
    placed.bend_mm = [&](double x, double) { return options.bend_mm * (1 - std::pow(2 * x / size.x() - 1, 2)); };
  std::uint64_t picture_number = 0;
  for (const Seen& seen : sensors_of(truth)) {
    progress.begin("rendering the board for " + seen.name);
    for (std::size_t k = 0; k < poses.size(); ++k) {
      placed.rig_from_board = poses[k];
      const std::uint64_t noise = static_cast<std::uint64_t>(seed) * 100'000 + picture_number++;
      const Image<std::uint8_t> picture = render_board(placed, seen.sensor, render, noise);
      write_gray_png(folder / seen.name / fmt::format("{:02}.png", k + 1), picture.view());
      progress.advance(double(k + 1) / double(poses.size()));
    }
  }
  write_rig(folder / "truth" / "rig.json", truth);
  write_board(folder / "board.json", board);
}

}  // namespace pagesweep::sim
