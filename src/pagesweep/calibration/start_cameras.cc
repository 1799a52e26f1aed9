// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "pagesweep/base/error.h"
#include "pagesweep/calibration/calibration_steps_internal.h"

namespace pagesweep {
namespace {

constexpr std::size_t fewest_pictures = 3;
constexpr double least_tilt_rad = 5 * std::numbers::pi / 180;  ///< between the boards of a camera's pictures
/// Two poses of one camera seen from another agree if they differ by less. Lenses that were calibrated one by one are
/// only good for a start, so this is wide.
constexpr double same_turn_rad = 4 * std::numbers::pi / 180;
constexpr double same_place = 0.15;  ///< of the distance to the board

double angle_between(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  return Eigen::AngleAxisd(Eigen::Matrix3d(a.transpose() * b)).angle();
}

/// What most of the refused pictures have in common, or nothing.
std::string commonest_problem(const SensorPictures& pictures, bool& wrong_board) {
  std::map<std::string, int> problems;
  for (const BoardPicture& picture : pictures.pictures)
    if (!picture.view.problem.empty()) ++problems[picture.view.problem];
  const auto most = std::ranges::max_element(problems, {}, [](const auto& item) { return item.second; });
  if (most == problems.end()) return "";
  const auto same = std::ranges::find(pictures.pictures, most->first,
                                      [](const BoardPicture& picture) { return picture.view.problem; });
  wrong_board = same->view.wrong_board;
  return fmt::format("{} of {} pictures: {}", most->second, pictures.pictures.size(), most->first);
}

void require_pictures(const SensorPictures& pictures) {
  const auto usable = static_cast<std::size_t>(std::ranges::count_if(
      pictures.pictures, [](const BoardPicture& picture) { return picture.view.problem.empty(); }));
  if (usable >= fewest_pictures) return;
  bool wrong_board = false;
  const std::string problem = commonest_problem(pictures, wrong_board);
  const std::string count =
      pictures.pictures.size() == 1
          ? fmt::format("{}: there is only one picture", pictures.name)
          : fmt::format("{}: {} of {} pictures show the board", pictures.name, usable, pictures.pictures.size());
  const std::string need =
      fmt::format("at least {} are needed, tilted differently; 15 to 20 are better", fewest_pictures);
  throw Error(wrong_board ? ErrorKind::bad_input : ErrorKind::no_result,
              problem.empty() ? fmt::format("{}; {}", count, need) : fmt::format("{}; {} ({})", count, need, problem));
}

/// One camera's views on their way to start values.
struct CameraStart {
  Camera camera;
  std::map<int, Rigid3> cam_from_board;  ///< by pose
};

std::vector<Observation> observations_of(const SensorPictures& pictures, int sensor) {
  std::vector<Observation> observations;
  for (const BoardPicture& picture : pictures.pictures)
    for (const BoardCorner& corner : picture.view.corners)
      observations.push_back({sensor, picture.pose, corner.number, corner.pixel});
  return observations;
}

/// Homographies of all views, by pose: picture coordinates relative to the picture's middle.
std::map<int, Eigen::Matrix3d> find_homographies(const CalibrationInput& input, const SensorPictures& pictures) {
  const Eigen::Vector2d middle(0.5 * (pictures.width - 1), 0.5 * (pictures.height - 1));
  std::map<int, Eigen::Matrix3d> homographies;
  for (const BoardPicture& picture : pictures.pictures) {
    std::vector<Eigen::Vector2d> plane, pixels;
    for (const BoardCorner& corner : picture.view.corners) {
      plane.push_back(input.board.corner_mm(corner.number));
      pixels.push_back(corner.pixel - middle);
    }
    if (const auto homography = find_homography(plane, pixels)) homographies[picture.pose] = *homography;
  }
  return homographies;
}

Camera first_guess(const SensorPictures& pictures, const std::map<int, Eigen::Matrix3d>& homographies) {
  std::vector<Eigen::Matrix3d> views;
  for (const auto& [pose, homography] : homographies) views.push_back(homography);
  Camera camera;
  camera.name = pictures.name;
  camera.width = pictures.width, camera.height = pictures.height;
  const double usual = 1.3 * std::max(pictures.width, pictures.height);  // where no view is tilted; refused later
  camera.fx = camera.fy = find_focal_length(views).value_or(usual);
  camera.cx = 0.5 * (pictures.width - 1), camera.cy = 0.5 * (pictures.height - 1);
  return camera;
}

void require_tilts(const CameraStart& start) {
  double widest = 0;
  for (const auto& [pose, a] : start.cam_from_board)
    for (const auto& [other, b] : start.cam_from_board)
      widest = std::max(widest, std::acos(std::clamp(a.rotation.col(2).dot(b.rotation.col(2)), -1.0, 1.0)));
  if (widest < least_tilt_rad)
    throw no_result(fmt::format(
        "{}: all poses of the board are parallel, within {:.1f} degrees: focal length and distance cannot be told "
        "apart; tilt the board by 20 to 40 degrees, in different directions",
        start.camera.name, widest * 180 / std::numbers::pi));
}

CameraStart start_camera(const CalibrationInput& input, const SensorPictures& pictures,
                         const CalibrationOptions& options) {
  const auto homographies = find_homographies(input, pictures);
  Bundle bundle{
      .board = input.board, .shape = {}, .sensors = {}, .rig_from_board = {}, .pose_is_held = {}, .observations = {}};
  const Camera guess = first_guess(pictures, homographies);
  const Eigen::Vector3d to_image(1 / guess.fx, 1 / guess.fy, 1);
  bundle.sensors.push_back({pictures.name, guess, 1, true, false});
  bundle.rig_from_board.resize(input.poses.size());
  bundle.pose_is_held.assign(input.poses.size(), false);
  for (const auto& [pose, homography] : homographies)
    bundle.rig_from_board[std::size_t(pose)] = pose_from_homography(to_image.asDiagonal() * homography);
  for (const Observation& seen : observations_of(pictures, 0))
    if (homographies.contains(seen.pose)) bundle.observations.push_back(seen);
  CameraStart start{guess, {}};
  const auto note_poses = [&] {
    for (const auto& [pose, homography] : homographies)
      start.cam_from_board[pose] = bundle.rig_from_board[std::size_t(pose)];
  };
  note_poses();
  require_tilts(start);
  // First with one coefficient of distortion: the others would make up for errors of the start values.
  solve(bundle, {LensModel::k1, false, false, 3.0, false});
  solve(bundle, {options.lens, false, false, 3.0, false});
  note_poses();
  require_tilts(start);
  start.camera = std::get<Camera>(bundle.sensors.front().model);
  return start;
}

// ---- where the cameras are to each other ----

bool agree(const Rigid3& a, const Rigid3& b, double distance_mm) {
  return angle_between(a.rotation, b.rotation) < same_turn_rad &&
         (a.translation - b.translation).norm() < same_place * distance_mm;
}

/// Camera `to` from camera `from`, pose by pose.
std::map<int, Rigid3> relative_poses(const CameraStart& from, const CameraStart& to) {
  std::map<int, Rigid3> relative;
  for (const auto& [pose, from_board] : from.cam_from_board)
    if (const auto other = to.cam_from_board.find(pose); other != to.cam_from_board.end())
      relative[pose] = other->second * from_board.inverse();
  return relative;
}

/// The relative pose that most poses of the board agree with.
Rigid3 agreed_pose(const std::map<int, Rigid3>& relative, double distance_mm, int& supporters) {
  supporters = 0;
  Rigid3 best;
  for (const auto& [pose, candidate] : relative) {
    const auto support = static_cast<int>(std::ranges::count_if(
        relative, [&](const auto& other) { return agree(other.second, candidate, distance_mm); }));
    if (support > supporters) supporters = support, best = candidate;
  }
  return best;
}

double typical_distance(const CameraStart& start) {
  double sum = 0;
  for (const auto& [pose, cam_from_board] : start.cam_from_board) sum += cam_from_board.translation.norm();
  return sum / static_cast<double>(start.cam_from_board.size());
}

std::string list_of(const CalibrationInput& input, const std::vector<int>& poses) {
  std::string list;
  for (const int pose : poses) list += (list.empty() ? "'" : "', '") + input.poses[std::size_t(pose)];
  return list + "'";
}

/// Poses whose pictures contradict the others: a few are left out, many are an error that names the likely cause.
std::vector<int> find_contradictions(const CalibrationInput& input, const std::map<int, Rigid3>& relative,
                                     const Rigid3& agreed, double distance_mm, const std::string& from,
                                     const std::string& to, std::vector<std::string>& warnings) {
  std::vector<int> odd, swapped;
  for (const auto& [pose, found] : relative) {
    if (agree(found, agreed, distance_mm)) continue;
    odd.push_back(pose);
    if (agree(found.inverse(), agreed, distance_mm)) swapped.push_back(pose);
  }
  if (!swapped.empty() && 2 * swapped.size() >= odd.size())
    throw Error(ErrorKind::bad_input, fmt::format("the pictures of {} and {} are swapped in {} of {} poses: {}", from,
                                                  to, swapped.size(), relative.size(), list_of(input, swapped)));
  if (3 * odd.size() > relative.size())
    throw Error(
        ErrorKind::bad_input,
        fmt::format("{} of {} poses contradict the others about where {} and {} are to each other: pictures of the "
                    "same name must show the board in the same place, none of them mirrored (among them {})",
                    odd.size(), relative.size(), from, to, list_of(input, odd)));
  if (!odd.empty())
    warnings.push_back(fmt::format("left out of {}: {}, which contradict what {} sees", to, list_of(input, odd), from));
  return odd;
}

void require_common_poses(const std::map<int, Rigid3>& relative, const std::string& from, const std::string& to) {
  if (relative.size() >= 2) return;
  throw Error(
      ErrorKind::bad_input,
      fmt::format("{} and {} see the board together in {} poses, and at least 2 are needed: pictures that belong "
                  "together must have the same name, or be as many in each folder",
                  from, to, relative.size()));
}

}  // namespace

Bundle start_cameras(const CalibrationInput& input, const CalibrationOptions& options,
                     std::vector<std::string>& warnings) {
  std::vector<CameraStart> starts;
  for (const SensorPictures& pictures : input.sensors) {
    require_pictures(pictures);
    if (!pictures.is_scanner) starts.push_back(start_camera(input, pictures, options));
  }
  if (starts.empty()) throw std::invalid_argument("a calibration needs at least one camera");
  Bundle bundle{
      .board = input.board, .shape = {}, .sensors = {}, .rig_from_board = {}, .pose_is_held = {}, .observations = {}};
  bundle.rig_from_board.resize(input.poses.size());
  bundle.pose_is_held.assign(input.poses.size(), false);
  std::vector<bool> is_known(input.poses.size(), false);
  const double distance_mm = typical_distance(starts.front());
  for (std::size_t k = 0; k < starts.size(); ++k) {
    const auto relative = relative_poses(starts.front(), starts[k]);
    require_common_poses(relative, starts.front().camera.name, starts[k].camera.name);
    int supporters = 0;
    const Rigid3 cam_from_first = agreed_pose(relative, distance_mm, supporters);
    const auto odd = find_contradictions(input, relative, cam_from_first, distance_mm, starts.front().camera.name,
                                         starts[k].camera.name, warnings);
    Camera camera = starts[k].camera;
    camera.cam_from_rig = cam_from_first;
    bundle.sensors.push_back({camera.name, camera, 1, k == 0, false});
    for (const auto& [pose, cam_from_board] : starts[k].cam_from_board) {
      if (std::ranges::find(odd, pose) != odd.end() || is_known[std::size_t(pose)]) continue;
      bundle.rig_from_board[std::size_t(pose)] = cam_from_first.inverse() * cam_from_board;
      is_known[std::size_t(pose)] = true;
    }
    for (const Observation& seen : observations_of(input.sensors[k], static_cast<int>(k)))
      if (std::ranges::find(odd, seen.pose) == odd.end() && is_known[std::size_t(seen.pose)])
        bundle.observations.push_back(seen);
  }
  return bundle;
}

}  // namespace pagesweep
