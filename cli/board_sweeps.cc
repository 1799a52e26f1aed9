// SPDX-License-Identifier: Apache-2.0
#include "cli/board_sweeps.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <optional>

#include "cli/board_pictures.h"
#include "cli/capture_input.h"
#include "pagesweep/base/error.h"
#include "pagesweep/base/median.h"
#include "pagesweep/calibration/light_sightings.h"
#include "pagesweep/io/capture_file.h"
#include "pagesweep/io/image_file.h"

namespace pagesweep::cli {
namespace {

namespace fs = std::filesystem;

/// The sensor of that name; a new one if there is none yet.
/// \throws Error  if it has pictures of another size
SensorPictures& sensor_of(CalibrationInput& input, const std::string& name, ImageSize size, bool is_scanner,
                          const fs::path& file) {
  auto sensor = std::ranges::find(input.sensors, name, &SensorPictures::name);
  if (sensor == input.sensors.end()) {
    // The scanner is the last.
    const auto place = std::ranges::find(input.sensors, true, &SensorPictures::is_scanner);
    sensor = input.sensors.insert(is_scanner ? input.sensors.end() : place,
                                  SensorPictures{name, size.width, size.height, is_scanner, {}});
  }
  if (sensor->width != size.width || sensor->height != size.height)
    throw bad_input(file, "",
                    fmt::format("has {} x {} px, but other pictures of {} have {} x {}: all must be of one size",
                                size.width, size.height, name, sensor->width, sensor->height));
  return *sensor;
}

/// Direction over the board in which time grows, by a plane through the times of its corners; nothing if they are few.
std::optional<Eigen::Vector2d> direction_over(const Board& board, const BoardView& view, const TimeMap& times) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  int count = 0;
  for (const BoardCorner& corner : view.corners) {
    // Beside a corner there is a white square, whichever way the board lies.
    std::vector<double> around;
    const int x = static_cast<int>(std::lround(corner.pixel.x())), y = static_cast<int>(std::lround(corner.pixel.y()));
    for (int dy = -3; dy <= 3; ++dy)
      for (int dx = -3; dx <= 3; ++dx)
        if (times.time.contains(x + dx, y + dy) && times.status(x + dx, y + dy) == PixelStatus::ok)
          around.push_back(times.time(x + dx, y + dy));
    if (around.size() < 5) continue;
    const Eigen::Vector2d place = board.corner_mm(corner.number);
    const Eigen::Vector3d row(place.x(), place.y(), 1);
    normal += row * row.transpose();
    right += row * median(std::move(around));
    ++count;
  }
  if (count < 6) return std::nullopt;
  const Eigen::Vector3d slope = normal.ldlt().solve(right);
  return Eigen::Vector2d(slope.x(), slope.y()).normalized();
}

void add_scan(const Capture& capture, int pose, const DetectionOptions& options, CalibrationInput& input) {
  const auto path = capture.scan_path();
  if (!path) return;
  const Image<std::uint8_t> gray = gray_of(read_picture(*path));
  SensorPictures& scanner = sensor_of(input, "scanner", {gray.width(), gray.height()}, true, *path);
  scanner.pictures.push_back({pose, path->string(), detect_board(gray.view(), input.board, options)});
}

WatchedSweep add_sweep(const fs::path& folder, const DetectionOptions& options, CalibrationInput& input,
                       Progress& progress) {
  const Capture capture = read_capture(folder);
  const auto source = open_capture(capture, read_camera_sizes(capture));
  BoardSweep seen = watch_board(*source, progress);
  WatchedSweep sweep{"sweep " + title_of(capture), static_cast<int>(input.poses.size()), {}, std::move(seen.timing)};
  input.poses.push_back(sweep.name);
  for (std::size_t c = 0; c < seen.textures.size(); ++c) {
    const Image<std::uint8_t>& texture = seen.textures[c];
    sweep.cameras.push_back(capture.sequences[c].camera);
    SensorPictures& sensor =
        sensor_of(input, sweep.cameras[c], {texture.width(), texture.height()}, false, capture.folder);
    const BoardView view = detect_board(texture.view(), input.board, options);
    if (const auto direction = direction_over(input.board, view, sweep.timing.maps[c]))
      input.light_directions.push_back({sweep.pose, *direction});
    sensor.pictures.push_back({sweep.pose, capture.folder.string(), view});
  }
  add_scan(capture, sweep.pose, options, input);
  return sweep;
}

}  // namespace

std::vector<WatchedSweep> add_sweeps(const std::vector<fs::path>& captures, const DetectionOptions& options,
                                     CalibrationInput& input, Progress& progress) {
  std::vector<WatchedSweep> sweeps;
  for (const fs::path& capture : captures) sweeps.push_back(add_sweep(capture, options, input, progress));
  return sweeps;
}

LightFit light_of(const std::vector<WatchedSweep>& sweeps, const Calibration& calibration) {
  std::vector<LightSighting> sightings;
  for (const WatchedSweep& sweep : sweeps) {
    const bool is_known = std::ranges::any_of(calibration.bundle.observations, [&](const Observation& observation) {
      return observation.pose == sweep.pose && observation.used;
    });
    if (!is_known) continue;
    const Board& board = calibration.bundle.board;
    const BoardPlace place{calibration.bundle.rig_from_board[static_cast<std::size_t>(sweep.pose)],
                           Eigen::Vector2d::Zero(), board.size_mm()};
    for (std::size_t c = 0; c < sweep.cameras.size(); ++c)
      if (const Camera* camera = calibration.rig.find_camera(sweep.cameras[c]))
        std::ranges::copy(light_sightings(sweep.timing.maps[c], *camera, place), std::back_inserter(sightings));
  }
  return fit_light(sightings);
}

void describe_sensors(const CalibrationInput& input, const std::vector<WatchedSweep>& sweeps, Rig& rig) {
  for (Camera& camera : rig.cameras) {
    std::vector<double> blur, gain, read_variance;
    for (const SensorPictures& sensor : input.sensors)
      for (const BoardPicture& picture : sensor.pictures)
        if (sensor.name == camera.name && picture.view.problem.empty()) blur.push_back(picture.view.blur_px);
    for (const WatchedSweep& sweep : sweeps)
      for (std::size_t c = 0; c < sweep.cameras.size(); ++c) {
        if (sweep.cameras[c] != camera.name) continue;
        gain.push_back(sweep.timing.noise[c].gain);
        read_variance.push_back(sweep.timing.noise[c].read_variance);
      }
    if (blur.empty() || gain.empty() || !(median(gain) > 0)) continue;
    camera.sensor = CameraSensor{median(gain), std::sqrt(median(read_variance)), median(blur)};
  }
}

}  // namespace pagesweep::cli
